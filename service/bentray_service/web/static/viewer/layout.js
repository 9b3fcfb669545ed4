// The elements of the viewer, and a row of buttons of which one is pressed.
import { make } from "../parts/dom.js";

const KEYS = `
  <dl>
    <dt>Arrows</dt><dd>move the cursor by a node</dd>
    <dt>Shift + arrows</dt><dd>move the image</dd>
    <dt>+ − 0</dt><dd>zoom in, out, whole image</dd>
    <dt>, .</dt><dd>darker and brighter colours: move the window</dd>
    <dt>[ ]</dt><dd>narrower and wider window</dd>
    <dt>A</dt><dd>automatic window</dd>
    <dt>Page up, Page down</dt><dd>next and previous slice</dd>
    <dt>Enter</dt><dd>begin and end a profile or region at the cursor</dd>
  </dl>
  <p>Mouse: the wheel zooms, dragging does what the tool says, a click sets the cursor. Touch: two fingers zoom.</p>`;

export const PAGE = `
  <div class="viewer-bar">
    <div class="choice-bar quantities" role="group" aria-label="Quantity"></div>
    <div class="choice-bar comparison-modes" role="group" aria-label="Comparison" hidden></div>
  </div>
  <p class="error" role="alert" hidden></p>
  <p class="loading" role="status" hidden></p>
  <div class="viewer-body">
    <div class="viewer-images">
      <div class="tiles"></div>
      <div class="swipe-row" hidden><label>Border <input type="range" min="0" max="1" step="0.01" name="swipe"></label>
        <label class="other">with <select name="other"></select></label></div>
      <div class="slices"></div>
      <p class="readout" aria-live="off"></p>
      <div class="colour-bar"><canvas width="256" height="1"></canvas><div class="ticks"></div><p class="unit"></p></div>
    </div>
    <div class="viewer-side">
      <fieldset class="tools"><legend class="caption">Dragging</legend></fieldset>
      <fieldset class="window"><legend class="caption">Window</legend>
        <label>from <input type="number" step="any" name="low"></label>
        <label>to <input type="number" step="any" name="high"></label>
        <button type="button" class="quiet automatic">Automatic</button>
        <label>Colours <select name="map"></select></label>
        <button type="button" class="quiet whole">Whole image</button>
        <label class="fade" hidden><input type="checkbox" name="fade"> Fade what is not known</label>
        <label class="planes" hidden><input type="checkbox" name="planes"> Three planes</label>
      </fieldset>
      <div class="measures"></div>
      <details class="keys"><summary>Keys and mouse</summary>${KEYS}</details>
    </div>
  </div>`;

// A row of buttons of which one is pressed.
export function choices(box, entries, chosen, onChoose) {
  box.replaceChildren(...entries.map(([name, title]) => {
    const button = make("button", "quiet", title);
    button.type = "button";
    button.dataset.name = name;
    button.setAttribute("aria-pressed", String(name === chosen));
    button.addEventListener("click", () => {
      for (const other of box.children) other.setAttribute("aria-pressed", String(other === button));
      onChoose(name);
    });
    return button;
  }));
}
