// The filters of the table of jobs: the parameters of GET /v1/jobs, with the values that its description accepts.
import { description } from "../parts/defaults.js";
import { make } from "../parts/dom.js";
import { inWords } from "../parts/job_words.js";

const TYPING_MS = 300;
const CHOICES = ["state", "kind"];

// The words of each list of choices, by parameter.
async function choices() {
  const { paths } = await description();
  const { parameters } = paths["/v1/jobs"].get;
  return Object.fromEntries(CHOICES.map((name) => [name, parameters.find((one) => one.name === name).schema.enum]));
}

function labelled(caption, field) {
  const label = make("label");
  label.append(make("span", "caption", caption), field);
  return label;
}

function choice(name, words, value) {
  const select = make("select");
  select.name = name;
  select.append(new Option("All", ""), ...words.map((word) => new Option(inWords(word), word)));
  select.value = words.includes(value) ? value : "";
  return select;
}

// A form with the values of query; onChange(query) is called with the changed ones, without the page of the list.
export async function jobFilters(query, onChange) {
  const words = await choices();
  const form = make("form", "filters");
  form.setAttribute("role", "search");
  form.setAttribute("aria-label", "Jobs");
  const text = make("input");
  Object.assign(text, { name: "text", type: "search", maxLength: 200, value: query.get("text") ?? "", autocomplete: "off" });
  const clear = make("button", "quiet", "Clear filters");
  clear.type = "button";
  form.append(
    labelled("Name, scan, notes, owner or id", text),
    ...CHOICES.map((name) => labelled(name === "state" ? "State" : "Kind", choice(name, words[name], query.get(name)))),
    clear,
  );
  const read = () => {
    const filled = [...new FormData(form)].map(([name, value]) => [name, value.trim()]).filter(([, value]) => value);
    return new URLSearchParams(filled);
  };
  let timer = 0;
  const changed = (wait) => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      clear.disabled = !read().size;
      onChange(read());
    }, wait);
  };
  clear.disabled = !read().size;
  text.addEventListener("input", () => changed(TYPING_MS));
  for (const select of form.querySelectorAll("select")) select.addEventListener("change", () => changed(0));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    changed(0);
  });
  clear.addEventListener("click", () => {
    for (const field of form.elements) if (field.name) field.value = "";
    text.focus();
    changed(0);
  });
  return { form, close: () => clearTimeout(timer) };
}
