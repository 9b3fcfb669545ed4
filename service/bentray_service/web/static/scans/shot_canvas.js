// The traces of one emission on a canvas: receivers across, time down, grey by amplitude, arrivals over them.
import { float32Of } from "../viewer/npy.js";
import { ticks } from "../viewer/plot.js";

const [LEFT, RIGHT, TOP, BOTTOM] = [52, 8, 8, 40];

function greys(shot, samples) {
  const picture = new OffscreenCanvas(shot.receivers, shot.samples);
  const context = picture.getContext("2d");
  const image = context.createImageData(shot.receivers, shot.samples);
  for (let receiver = 0; receiver < shot.receivers; receiver += 1) {
    for (let k = 0; k < shot.samples; k += 1) {
      const at = 4 * (k * shot.receivers + receiver);
      image.data.fill(127.5 * (1 + samples[receiver * shot.samples + k]), at, at + 3);
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return picture;
}

export class ShotCanvas {
  constructor(canvas) {
    this.canvas = canvas;
    this.shot = null;
    this.cursor = 0;
    this.watching = [new ResizeObserver(() => this.draw()), new MutationObserver(() => this.draw())];
    this.watching[0].observe(canvas);
    this.watching[1].observe(document.documentElement, { attributeFilter: ["data-theme"] });
  }

  close() {
    for (const one of this.watching) one.disconnect();
  }

  // cursor: the receiver that is marked, counted in the picture.
  show(shot, cursor) {
    // Receivers, samples.
    if (shot !== this.shot) this.picture = greys(shot, float32Of(shot.traces));
    Object.assign(this, { shot, cursor });
    this.draw();
  }

  // The receiver, counted in the picture, at a distance from the left edge in CSS pixels.
  receiverAt(x) {
    const width = this.canvas.clientWidth - LEFT - RIGHT;
    return Math.min(this.shot.receivers - 1, Math.max(0, Math.floor(((x - LEFT) / width) * this.shot.receivers)));
  }

  draw() {
    const { canvas, shot } = this;
    if (!shot || !canvas.clientWidth) return;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const colours = getComputedStyle(canvas);
    const ink = colours.getPropertyValue("--soft");
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const box = [LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM];
    pen.imageSmoothingEnabled = shot.samples > ratio * box[3] || shot.receivers > ratio * box[2];
    pen.drawImage(this.picture, ...box);
    const last = shot.first_s + shot.samples * shot.step_s;
    // A sample and a receiver are as wide as their pixel; their values are those of its middle.
    const px = (receiver) => LEFT + ((receiver + 0.5) / shot.receivers) * box[2];
    const py = (seconds) => TOP + ((seconds - shot.first_s + 0.5 * shot.step_s) / (last - shot.first_s)) * box[3];
    this.axes(pen, ink, box, px, py, last);
    pen.save();
    pen.beginPath();
    pen.rect(...box);
    pen.clip();
    this.arrivals(pen, px, py, colours);
    pen.restore();
  }

  axes(pen, ink, [left, top, across, down], px, py, last) {
    const { shot } = this;
    pen.fillStyle = ink;
    pen.font = '12px system-ui, "DejaVu Sans", sans-serif';
    pen.textAlign = "right";
    for (const time of ticks(1e6 * shot.first_s, 1e6 * last, 6)) pen.fillText(String(time), left - 6, Math.min(py(1e-6 * time) + 4, top + down));
    pen.textAlign = "center";
    for (const receiver of ticks(0, shot.receivers - 1, Math.max(2, Math.floor(across / 80)))) {
      if (Number.isInteger(receiver)) pen.fillText(String(shot.receiver_element[receiver]), px(receiver), top + down + 15);
    }
    pen.fillText("receiving element", left + across / 2, top + down + 33);
    pen.save();
    pen.translate(12, top + down / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText("time (µs)", 0, 0);
    pen.restore();
  }

  arrivals(pen, px, py, colours) {
    const { shot } = this;
    pen.fillStyle = colours.getPropertyValue("--pick");
    const radius = shot.receivers > 100 ? 1.6 : 3;
    (shot.pick_s ?? []).forEach((time, k) => {
      if (time === null) return;
      pen.beginPath();
      pen.arc(px(k), py(time), radius, 0, 2 * Math.PI);
      pen.fill();
    });
    pen.strokeStyle = colours.getPropertyValue("--straight");
    pen.lineWidth = 1.5;
    pen.setLineDash([7, 5]);
    pen.beginPath();
    shot.straight_s.forEach((time, k) => pen.lineTo(px(k), py(time)));
    pen.stroke();
    pen.setLineDash([]);
    pen.strokeStyle = colours.getPropertyValue("--warm");
    pen.lineWidth = 1;
    pen.strokeRect(px(this.cursor) - 2, 0, 4, 1e4);
  }
}
