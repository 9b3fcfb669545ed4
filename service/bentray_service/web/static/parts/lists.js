// What the lists of scans and jobs share: pages of a list that is newest first, and fields that search while one types.
import { linkTo } from "./address.js";
import { html, useLater } from "./view.js";

const TYPING_MS = 300;

// The parameter "before" of the next page, from its address; "" on the last one.
export const olderOf = (next) => (next ? new URLSearchParams(next.split("?")[1]).get("before") : "");

// Links to the newest and to older records. query: what the list shows; older: "before" of the next page.
export function ListPages({ path, query, older, words, ...more }) {
  const address = (before) => {
    const turned = new URLSearchParams(query);
    turned.delete("before");
    if (before) turned.set("before", before);
    return linkTo(path, turned);
  };
  return html`<nav class="pages" aria-label="Pages of the list" ...${more}>
    ${query.has("before") && html`<a class="button" href=${address("")}>Newest ${words}</a>`}
    ${older && html`<a class="button" href=${address(older)}>Older ${words}</a>`}
  </nav>`;
}

// A form of filters; onChange(query) gets its filled fields, without "before", when they change or are submitted.
export function Filters({ label, onChange, children, ...more }) {
  const later = useLater();
  const read = (form) => {
    const filled = [...new FormData(form)].map(([name, value]) => [name, value.trim()]).filter(([, value]) => value);
    onChange(new URLSearchParams(filled));
  };
  const submit = (event) => {
    event.preventDefault();
    read(event.currentTarget);
  };
  const onInput = ({ currentTarget, target }) => later(() => read(currentTarget), target.type === "search" ? TYPING_MS : 0);
  return html`<form class="filters" role="search" aria-label=${label} onInput=${onInput} onSubmit=${submit} ...${more}>${children}</form>`;
}
