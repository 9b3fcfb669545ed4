// The controls of the viewer: quantity, comparison, slices, tool, window and colours.
import { Button, html, Options, useLayoutEffect, useRef } from "../parts/view.js";
import { NAMES } from "./colour_bar.js";
import { AXES } from "./field.js";
import { TOOLS, WHOLE_VIEWS } from "./state.js";

const MAPS = NAMES.map((name) => [name, name === "RdBu_r" ? "blue–red" : name]);

// A row of buttons of which one is pressed. entries: [name, title].
export function ChoiceBar({ label, className, entries, chosen, onChoose }) {
  return html`<div class=${`choice-bar ${className}`} role="group" aria-label=${label}>
    ${entries.map(([name, title]) => html`<${Button} key=${name} data-name=${name} aria-pressed=${name === chosen} onClick=${() => onChoose(name)}>${title}</${Button}>`)}
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

// setWindow(low, high) takes only sensible limits; fades and sliced: whether the image can be faded and shown in three planes.
export function Window({ low, high, map, fade, planes, fades, sliced, setWindow, change }) {
  const set = (event) => {
    const { elements } = event.target.closest("fieldset");
    setWindow(elements.low.valueAsNumber, elements.high.valueAsNumber);
  };
  const limit = (value) => Number(value.toPrecision(6));
  return html`<fieldset class="window">
    <legend class="caption">Window</legend>
    <label>from <${NumberField} name="low" value=${limit(low)} onChange=${set} /></label>
    <label>to <${NumberField} name="high" value=${limit(high)} onChange=${set} /></label>
    <${Button} onClick=${() => change({ window: null })}>Automatic</${Button}>
    <label>Colours <select name="map" value=${map} onChange=${({ target }) => change({ map: target.value })}><${Options} entries=${MAPS} /></select></label>
    <${Button} onClick=${() => change({ views: WHOLE_VIEWS })}>Whole image</${Button}>
    <label class="fade" hidden=${!fades}><input type="checkbox" name="fade" checked=${fade} onChange=${({ target }) => change({ fade: target.checked })} /> Fade what is not known</label>
    <label class="planes" hidden=${!sliced}><input type="checkbox" name="planes" checked=${planes} onChange=${({ target }) => change({ planes: target.checked })} /> Three planes</label>
  </fieldset>`;
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
