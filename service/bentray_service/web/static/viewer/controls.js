// The controls of the viewer: quantity, comparison, slices, tool, window and colours.
import { Button, html, Options, useLayoutEffect, useRef } from "../parts/view.js";
import { NAMES } from "./colour_bar.js";
import { AXES } from "./field.js";
import { INTERPOLATIONS, TOOLS, WHOLE_VIEWS } from "./state.js";

const MAPS = NAMES.map((name) => [name, name === "RdBu_r" ? "blue–red" : name]);

export const percent = (share) => `${Math.round(100 * share)} %`;

// A row of buttons of which one is pressed. entries: [name, title]; notes: by name, why what a button shows is not to be trusted, which greys it.
export function ChoiceBar({ label, className, entries, chosen, notes = {}, onChoose }) {
  return html`<div class=${`choice-bar ${className}`} role="group" aria-label=${label}>
    ${entries.map(([name, title]) => html`<${Button} key=${name} data-name=${name} data-grey=${notes[name] && ""} title=${notes[name]} aria-pressed=${name === chosen} onClick=${() => onChoose(name)}>${title}</${Button}>`)}
  </div>`;
}

// A number that is not overwritten while it is edited.
export function NumberField({ value, ...more }) {
  const input = useRef(null);
  useLayoutEffect(() => {
    if (document.activeElement !== input.current) input.current.value = value;
  });
  return html`<input type="number" step="any" ref=${input} ...${more} />`;
}

// axes: those with a slider each; axis: the chosen one, or null where it cannot be chosen.
export function Slices({ main, axes, axis, cursor, onMove, onAxis }) {
  const wordsOf = (of, index) => {
    const where = main.uneven && of === "z" ? "" : `, ${of} = ${Number(main.position(of, index).toFixed(2))} mm`;
    return `Slice ${index} of 0 to ${main.count(of) - 1}${where}`;
  };
  return html`<div class="slices">
    ${axes.map((of) => {
      const index = main.nearest(of, cursor[AXES.indexOf(of)]);
      return html`<label class="slice" key=${of}>
        <span>${wordsOf(of, index)}</span>
        <input type="range" min="0" max=${main.count(of) - 1} step="1" value=${index} aria-label=${`Slice across ${of}`}
          onInput=${({ target }) => onMove(of, Number(target.value))} />
      </label>`;
    })}
    ${axis && html`<select aria-label="Axis across the slice" onChange=${({ target }) => onAxis(target.value)}>
      <${Options} entries=${main.axes.map((of) => [of, `across ${of}`])} chosen=${axis} />
    </select>`}
  </div>`;
}

// The border between two images, and which the second is. panes: all; other: its number.
export function Swipe({ panes, other, swipe, change }) {
  return html`<div class="swipe-row">
    <label>Border <input type="range" min="0" max="1" step="0.01" name="swipe" value=${swipe} onInput=${({ target }) => change({ swipe: Number(target.value) })} /></label>
    <label class="other" hidden=${panes.length < 3}>with ${" "}
      <select name="other" onChange=${({ target }) => change({ other: Number(target.value) })}>
        <${Options} entries=${panes.slice(1).map(({ title }, k) => [k + 1, title])} chosen=${other} />
      </select></label>
  </div>`;
}

export function Tools({ tool, change }) {
  return html`<fieldset class="tools">
    <legend class="caption">Dragging</legend>
    ${Object.entries(TOOLS).map(([name, title]) => html`<label>
      <input type="radio" name="tool" value=${name} checked=${name === tool} onChange=${() => change({ tool: name })} />${title}
    </label>`)}
  </fieldset>`;
}

// The window and the map of colours: onWindow([low, high]), or null for the automatic one; onMap(name). before: of the labels.
export function Colours({ title, before = "", low, high, map, onWindow, onMap, children }) {
  const set = (event) => {
    const { elements } = event.target.closest("fieldset");
    onWindow([elements.low.valueAsNumber, elements.high.valueAsNumber]);
  };
  const limit = (value) => Number(value.toPrecision(6));
  return html`<fieldset class="window">
    <legend class="caption">${title}</legend>
    <label>${before}from <${NumberField} name="low" value=${limit(low)} onChange=${set} /></label>
    <label>to <${NumberField} name="high" aria-label=${`${before}to`} value=${limit(high)} onChange=${set} /></label>
    <${Button} onClick=${() => onWindow(null)}>Automatic</${Button}>
    <label>Colours <select name="map" value=${map} onChange=${({ target }) => onMap(target.value)}><${Options} entries=${MAPS} /></select></label>
    ${children}
  </fieldset>`;
}

// A box that sets a field of the state. hidden: where it has no effect.
export const Switch = ({ name, state, change, hidden, children }) => html`<label class=${name} hidden=${hidden}>
  <input type="checkbox" name=${name} checked=${state[name]} onChange=${({ target }) => change({ [name]: target.checked })} /> ${children}</label>`;

// How the image is drawn; fades and sliced: whether it can be faded and shown in three planes.
export function Drawing({ state, fades, sliced, change }) {
  return html`
    <label>Between nodes <select name="interpolation" onChange=${({ target }) => change({ interpolation: target.value })}>
      <${Options} entries=${INTERPOLATIONS} chosen=${state.interpolation} /></select></label>
    <${Button} onClick=${() => change({ views: WHOLE_VIEWS })}>Whole image</${Button}>
    <${Switch} name="fade" state=${state} change=${change} hidden=${!fades}>Fade what is not known</${Switch}>
    <${Switch} name="planes" state=${state} change=${change} hidden=${!sliced}>Three planes</${Switch}>`;
}

// What lies above the image, and how opaque it is. entries: [name, title] of the quantities to choose from.
export function Overlay({ entries, state: { over, opacity }, change }) {
  const choose = ({ target }) => change({ over: target.value || null, overWindow: null, overMap: null, clear: false });
  return html`<div class="overlay">
    <label>Overlay <select name="over" aria-label="Overlay" onChange=${choose}><${Options} entries=${[["", "none"], ...entries]} chosen=${over ?? ""} /></select></label>
    ${over && html`<label><span>Opacity</span> <input type="range" name="opacity" aria-label="Opacity" min="0" max="1" step="0.05" value=${opacity} aria-valuetext=${percent(opacity)}
      onInput=${({ target }) => change({ opacity: Number(target.value) })} /> <output>${percent(opacity)}</output></label>`}
  </div>`;
}

export function Keys() {
  return html`<details class="keys">
    <summary>Keys and mouse</summary>
    <dl>
      <dt>Arrows</dt><dd>move the cursor by a node</dd>
      <dt>Shift + arrows</dt><dd>move the image</dd>
      <dt>+ − 0</dt><dd>zoom in, out, whole image</dd>
      <dt>, .</dt><dd>darker and brighter colours: move the window</dd>
      <dt>[ ]</dt><dd>narrower and wider window</dd>
      <dt>A</dt><dd>automatic window</dd>
      <dt>Page up, Page down</dt><dd>next and previous slice</dd>
      <dt>Enter</dt><dd>set a point at the cursor: of a distance, an angle, an area, a profile or a region</dd>
      <dt>Escape</dt><dd>drop the points that are set</dd>
    </dl>
    <p>Mouse: the wheel zooms, dragging does what the tool says, a click sets the cursor. Touch: two fingers zoom.</p>
  </details>`;
}
