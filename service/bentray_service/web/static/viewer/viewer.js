// Results on canvases with one range of colours and one cursor: quantities, planes, window, profile, region.
import { make } from "../parts/dom.js";
import { showColourBar } from "./colour_bar.js";
import { NAMES } from "./colormaps.js";
import { AXES, difference } from "./field.js";
import { ImageView } from "./image_view.js";
import { choices, PAGE } from "./layout.js";
import { measuresPanel } from "./measures_panel.js";
import { robustLimits } from "./measures.js";
import { watch } from "./pointing.js";
import { FADED, QUANTITIES, shown, shownOf } from "./quantities.js";
import { MODES, queryOfState, TOOLS } from "./state.js";

const SAVE_MS = 250;

// panes: [{ title, values, stored }], with Values and the names of the stored quantities. keep(query): called when the view changes.
// Returns { close, state }.
export function viewer(root, panes, state, keep) {
  root.innerHTML = PAGE;
  const find = (selector) => root.querySelector(selector);
  const names = shownOf(panes.map((one) => one.stored).reduce((all, mine) => all.filter((one) => mine.includes(one))));
  if (!names.includes(state.quantity)) [state.quantity] = names;
  state.other = Math.max(1, Math.min(state.other, panes.length - 1));
  let fields = [];
  // Of the uncertainty of the only pane, while it fades the image.
  let spread = null;
  // Truth and uncertainty of the only pane, read for the first region.
  const besides = {};
  let tiles = [];
  let automatic = [0, 1];
  let hover = null;
  let frame = 0;
  let saving = 0;
  let asked = 0;
  let closed = false;
  const planes = new Map();

  const quantity = () => QUANTITIES[state.quantity];
  const comparing = () => panes.length > 1 && state.mode === "difference";
  const map = () => state.map ?? (comparing() ? "RdBu_r" : quantity().map);
  const window_ = () => state.window ?? automatic;
  const viewOf = (axis) => state.views[axis] ?? { centre: null, zoom: 1 };
  const main = () => fields[0];
  const inPlane = (axis) => [0, 1, 2].filter((one) => one !== AXES.indexOf(axis));

  // The plane of a pane at the cursor; the same object for the same values, so that it is coloured once.
  function planeOf(number, axis) {
    const field = fields[number];
    const index = field.nearest(axis, state.cursor[AXES.indexOf(axis)]);
    const key = `${number} ${axis}`;
    const before = planes.get(key);
    if (before?.index === index && before.field === field) return before.plane;
    const plane = field.plane(axis, index);
    planes.set(key, { field, index, plane });
    return plane;
  }

  function differenceOf(number, axis) {
    const [one, first] = [planeOf(number, axis), planeOf(0, axis)];
    const key = `difference ${number} ${axis}`;
    const before = planes.get(key);
    if (before?.one === one && before.first === first) return before.plane;
    const plane = difference(one, first);
    planes.set(key, { one, first, plane });
    return plane;
  }

  // The deviations of the nodes of a plane; the same object for the same plane.
  function deviationsOf(axis) {
    if (!spread) return null;
    const index = spread.nearest(axis, state.cursor[AXES.indexOf(axis)]);
    const key = `deviations ${axis}`;
    const before = planes.get(key);
    if (before?.index === index) return before.plane;
    const plane = spread.plane(axis, index);
    planes.set(key, { index, plane });
    return plane;
  }

  const fades = () => panes.length === 1 && panes[0].stored.includes("uncertainty") && FADED.includes(state.quantity);

  const shownPlane = ({ number, axis, minus }) => (minus ? differenceOf(number, axis) : planeOf(number, axis));

  function layout() {
    if (panes.length === 1) {
      const axes = state.planes ? main().axes : [state.axis];
      return axes.map((axis) => ({ number: 0, axis, title: state.planes ? `across ${axis}` : "" }));
    }
    const at = { axis: state.axis };
    const [first] = panes;
    if (state.mode === "side") return panes.map((one, number) => ({ number, ...at, title: one.title }));
    if (state.mode === "difference") {
      return panes.slice(1).map((one, k) => ({ number: k + 1, ...at, minus: true, title: `${one.title} minus ${first.title}` }));
    }
    return [{ number: 0, ...at, other: state.other, title: `${first.title} | ${panes[state.other].title}` }];
  }

  function rebuild() {
    // Pressed before the values are here: they are shown in the chosen way.
    if (!fields.length) return;
    for (const tile of tiles) tile.image.close();
    if (!main().axes.includes(state.axis)) state.axis = "z";
    tiles = layout().map((tile) => {
      const canvas = make("canvas", "plane");
      canvas.tabIndex = 0;
      canvas.setAttribute("role", "application");
      canvas.setAttribute("aria-roledescription", "image");
      const what = `Image of ${quantity().words}${tile.title ? `, ${tile.title}` : ""}; arrow keys move the cursor`;
      canvas.setAttribute("aria-label", what);
      const box = make("figure", "tile");
      box.append(canvas);
      if (tile.title) box.append(make("figcaption", "", tile.title));
      const made = { ...tile, canvas, box, image: new ImageView(canvas) };
      watch(canvas, made.image, actionsOf(made));
      return made;
    });
    find(".tiles").replaceChildren(...tiles.map((one) => one.box));
    find(".tiles").dataset.count = tiles.length;
    showSlices();
    find(".swipe-row").hidden = state.mode !== "swipe" || panes.length < 2;
    if (!state.window) measureWindow();
    refresh();
  }

  function measureWindow() {
    const { limits, symmetric, least } = quantity();
    const arrays = comparing() ? tiles.map((tile) => shownPlane(tile).values) : fields.map((one) => one.values);
    const [low, high] = robustLimits(arrays);
    const reach = Math.max(Math.abs(low), Math.abs(high));
    if (comparing() || symmetric) automatic = [-reach, reach];
    else automatic = limits ?? [least ?? low, high];
  }

  function showSlices() {
    const axes = [...new Set(tiles.map((one) => one.axis))].filter((axis) => main().count(axis) > 1);
    const rows = axes.map((axis) => {
      const row = make("label", "slice");
      const slider = make("input");
      Object.assign(slider, { type: "range", min: 0, max: main().count(axis) - 1, step: 1 });
      slider.dataset.axis = axis;
      slider.setAttribute("aria-label", `Slice across ${axis}`);
      slider.addEventListener("input", () => {
        state.cursor[AXES.indexOf(axis)] = main().position(axis, Number(slider.value));
        refresh();
      });
      row.append(make("span", "", ""), slider);
      return row;
    });
    if (main().axes.length > 1 && !state.planes) {
      const choice = make("select");
      choice.setAttribute("aria-label", "Axis across the slice");
      choice.append(...main().axes.map((axis) => new Option(`across ${axis}`, axis, false, axis === state.axis)));
      choice.addEventListener("change", () => {
        state.axis = choice.value;
        rebuild();
      });
      rows.push(choice);
    }
    find(".slices").replaceChildren(...rows);
  }

  // Draw once a frame, however often the state changes.
  function refresh() {
    if (!frame) frame = requestAnimationFrame(draw);
    clearTimeout(saving);
    saving = setTimeout(() => !closed && keep(queryOfState(state)), SAVE_MS);
  }

  function draw() {
    frame = 0;
    if (closed || !fields.length) return;
    const [low, high] = window_();
    for (const tile of tiles) {
      const [first, second] = inPlane(tile.axis);
      const linked = hover && hover.tile !== tile && hover.tile.axis === tile.axis ? hover.place : null;
      const marks = {
        cursor: linked ?? [state.cursor[first], state.cursor[second]],
        ...(tile.axis === state.axis && { profile: state.profile, region: state.region }),
      };
      const other = tile.other ? planeOf(tile.other, tile.axis) : null;
      tile.image.show(shownPlane(tile), { low, high, map: map(), other, swipe: state.swipe, deviations: deviationsOf(tile.axis), ...viewOf(tile.axis), marks });
      tile.canvas.classList.toggle("grip", state.tool !== "pan" || viewOf(tile.axis).zoom > 1);
    }
    for (const slider of root.querySelectorAll(".slices input")) {
      const { axis } = slider.dataset;
      const index = main().nearest(axis, state.cursor[AXES.indexOf(axis)]);
      slider.value = index;
      const where = main().uneven && axis === "z" ? "" : `, ${axis} = ${Number(main().position(axis, index).toFixed(2))} mm`;
      slider.previousElementSibling.textContent = `Slice ${index} of 0 to ${slider.max}${where}`;
    }
    showReadout();
    showColours(low, high);
    showMeasures();
  }

  function showReadout() {
    const at = hover ?? { tile: tiles[0], place: inPlane(tiles[0].axis).map((one) => state.cursor[one]) };
    const [x, y] = at.place;
    const { axis } = at.tile;
    const { names: [across, up] } = shownPlane(at.tile);
    const reads = [`${across} ${x.toFixed(2)} mm`, `${up} ${y.toFixed(2)} mm`];
    const field = fields[at.tile.number];
    const k = AXES.indexOf(axis);
    const slice = field.nearest(axis, state.cursor[k]);
    if (field.dimension === 3 && !(field.uneven && axis === "z")) reads.splice(k, 0, `${axis} ${field.position(axis, slice).toFixed(2)} mm`);
    const { unit } = quantity();
    const readIn = (plane) => {
      const a = Math.round((x - plane.origin[0]) / plane.spacing[0]);
      const b = Math.round((y - plane.origin[1]) / plane.spacing[1]);
      return a >= 0 && b >= 0 && a < plane.na && b < plane.nb ? plane.values[a * plane.nb + b] : NaN;
    };
    const out = find(".readout");
    const { node, value } = at.tile.image.at(x, y);
    if (panes.length === 1 || comparing()) {
      reads.push(`${shown(value, quantity())} ${unit}`);
      if (node) reads.push(`node ${(field.dimension === 3 ? [...node.slice(0, k), slice, ...node.slice(k)] : node).join(", ")}`);
    } else {
      panes.forEach((one, number) => reads.push(`${one.title}: ${shown(readIn(planeOf(number, axis)), quantity())} ${unit}`));
    }
    out.textContent = reads.join(" · ");
    Object.assign(out.dataset, { value, x, y, node: node ? node.join(",") : "" });
  }

  function showColours(low, high) {
    showColourBar(find(".colour-bar"), low, high, map());
    const { words, unit } = quantity();
    find(".colour-bar .unit").textContent = `${comparing() ? "difference of " : ""}${words}${unit ? ` (${unit})` : ""}`;
    for (const [name, value] of [["low", low], ["high", high]]) {
      const input = find(`input[name=${name}]`);
      if (document.activeElement !== input) input.value = Number(value.toPrecision(6));
    }
    find("select[name=map]").value = map();
  }

  const measures = measuresPanel(find(".measures"), {
    setProfile: (place) => change({ profile: place }),
    setRegion: (region) => change({ region }),
  });

  function showMeasures() {
    const chosen = tiles.filter((tile) => tile.axis === state.axis);
    const curves = chosen.flatMap((tile) => [
      { title: tile.title || panes[0].title, plane: shownPlane(tile) },
      ...(tile.other ? [{ title: panes[tile.other].title, plane: planeOf(tile.other, tile.axis) }] : []),
    ]);
    if (curves.length && chosen[0].other) curves[0].title = panes[0].title;
    if (!curves.length) return;
    const trueOne = besideRegion("truth");
    const beside = trueOne ? [{ title: QUANTITIES.truth.title, plane: trueOne }] : [];
    measures.show(curves, state, quantity(), beside, besideRegion("uncertainty"));
  }

  // A stored quantity beside a region of the speed, at the shown plane; read once, and then drawn. Null before that.
  function besideRegion(name) {
    if (!state.region || state.quantity !== "speed" || panes.length > 1 || !panes[0].stored.includes(name)) return null;
    const { axis } = state;
    besides[name] ??= panes[0].values.field(name).then((field) => {
      besides[name] = field;
      refresh();
    }, () => {});
    const field = besides[name];
    return field.nearest ? field.plane(axis, field.nearest(axis, state.cursor[AXES.indexOf(axis)])) : null;
  }

  function change(part) {
    Object.assign(state, part);
    refresh();
  }

  function setWindow(low, high) {
    if (Number.isFinite(low) && Number.isFinite(high) && high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high), 1e-30)) change({ window: [low, high] });
  }

  function setCursor(tile, x, y) {
    const [first, second] = inPlane(tile.axis);
    const place = (axis, value) => main().position(AXES[axis], main().nearest(AXES[axis], value));
    state.cursor[first] = place(first, x);
    state.cursor[second] = place(second, y);
    refresh();
  }

  function actionsOf(tile) {
    const { axis } = tile;
    return {
      state: () => state,
      view: () => viewOf(axis),
      setView(centre, zoom) {
        state.views[axis] = { centre, zoom };
        refresh();
      },
      window: window_,
      setWindow,
      hover(place) {
        hover = place && { tile, place: tile.image.toPlane(...place) };
        find(".readout").setAttribute("aria-live", "off");
        if (!frame) frame = requestAnimationFrame(draw);
      },
      cursor: () => inPlane(axis).map((one) => state.cursor[one]),
      setCursor: (x, y) => setCursor(tile, x, y),
      moveCursor(da, db) {
        hover = null;
        // Spoken, since a key moved it.
        find(".readout").setAttribute("aria-live", "polite");
        const [first, second] = inPlane(axis);
        setCursor(tile, state.cursor[first] + da * main().spacing[first], state.cursor[second] + db * main().spacing[second]);
      },
      moveSlice(by) {
        const k = AXES.indexOf(axis);
        const index = main().nearest(axis, state.cursor[k]) + by;
        if (index >= 0 && index < main().count(axis)) state.cursor[k] = main().position(axis, index);
        refresh();
      },
      draw(place) {
        state.axis = axis;
        if (state.tool === "profile") change({ profile: place });
        else change({ region: { shape: state.tool, place } });
      },
      automatic: () => change({ window: null }),
      reset: () => {
        delete state.views[axis];
        refresh();
      },
    };
  }

  // Read the values of a quantity, and show them.
  async function load() {
    const mine = ++asked;
    const status = find(".loading");
    status.hidden = false;
    status.textContent = "Reading the values";
    find(".error").hidden = true;
    root.setAttribute("aria-busy", "true");
    const shares = panes.map(() => 0);
    try {
      const read = await Promise.all(panes.map((one, k) => one.values.field(state.quantity, (share) => {
        shares[k] = share;
        status.textContent = `Reading the values, ${Math.floor((100 * shares.reduce((a, b) => a + b)) / shares.length)} %`;
      })));
      const deviations = state.fade && fades() ? await panes[0].values.field("uncertainty") : null;
      if (closed || mine !== asked) return;
      fields = read;
      spread = deviations;
      planes.clear();
      const middle = [0, 1, 2].map((k) => (k < main().dimension ? main().position(AXES[k], Math.floor(main().shape[k] / 2)) : 0));
      state.cursor ??= middle;
      find(".fade").hidden = !fades();
      find(".planes").hidden = panes.length > 1 || main().axes.length === 1;
      if (find(".planes").hidden) state.planes = false;
      rebuild();
    } catch (error) {
      if (closed || mine !== asked) return;
      find(".error").textContent = error.message;
      find(".error").hidden = false;
    } finally {
      if (mine === asked) {
        status.hidden = true;
        root.removeAttribute("aria-busy");
      }
    }
  }

  choices(find(".quantities"), names.map((name) => [name, QUANTITIES[name].title]), state.quantity, (name) => {
    Object.assign(state, { quantity: name, window: null, map: null });
    load();
  });
  if (panes.length > 1) {
    find(".comparison-modes").hidden = false;
    choices(find(".comparison-modes"), Object.entries(MODES), state.mode, (mode) => {
      Object.assign(state, { mode, window: null, map: null });
      rebuild();
    });
    const other = find("select[name=other]");
    other.append(...panes.slice(1).map((one, k) => new Option(one.title, k + 1)));
    other.value = state.other;
    other.closest("label").hidden = panes.length < 3;
    other.addEventListener("change", () => {
      state.other = Number(other.value);
      rebuild();
    });
    const swipe = find("input[name=swipe]");
    swipe.value = state.swipe;
    swipe.addEventListener("input", () => change({ swipe: Number(swipe.value) }));
  }
  for (const [name, title] of Object.entries(TOOLS)) {
    const label = make("label", "", title);
    const input = make("input");
    Object.assign(input, { type: "radio", name: "tool", value: name, checked: name === state.tool });
    input.addEventListener("change", () => change({ tool: name }));
    label.prepend(input);
    find(".tools").append(label);
  }
  find("select[name=map]").append(...NAMES.map((name) => new Option(name === "RdBu_r" ? "blue–red" : name, name)));
  find("select[name=map]").addEventListener("change", (event) => change({ map: event.target.value }));
  for (const name of ["low", "high"]) {
    find(`input[name=${name}]`).addEventListener("change", () => {
      const [low, high] = ["low", "high"].map((one) => find(`input[name=${one}]`).valueAsNumber);
      setWindow(low, high);
    });
  }
  find(".automatic").addEventListener("click", () => change({ window: null }));
  find(".whole").addEventListener("click", () => change({ views: {} }));
  find("input[name=fade]").checked = state.fade;
  find("input[name=fade]").addEventListener("change", (event) => {
    state.fade = event.target.checked;
    load();
  });
  find("input[name=planes]").checked = state.planes;
  find("input[name=planes]").addEventListener("change", (event) => {
    state.planes = event.target.checked;
    rebuild();
  });
  load();
  return {
    state,
    close() {
      closed = true;
      clearTimeout(saving);
      cancelAnimationFrame(frame);
      for (const tile of tiles) tile.image.close();
    },
  };
}
