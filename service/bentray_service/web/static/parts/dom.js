// Elements of the shell by their ids.

export const at = (id) => document.getElementById(id);
