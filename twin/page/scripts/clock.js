// The time of what is played, a recording or a replay: a slider, a button that plays, and the film's picture.
"use strict";

class Clock {
  // set: is called with the time of the recording in s
  constructor(told, element, set) {
    this.film = told.film.frames || [];
    this.labelled = this.film.filter((f) => f.labels);
    const times = [...(told.cameras.times || []), ...told.parts.flatMap((p) => p.times)];
    this.recording = { end: times.length ? Math.max(...times) : 0, wanted: 0, film: true, set };
    this.track = this.recording;
    this.slider = element.querySelector("input[name=time]");
    this.button = element.querySelector("button");
    this.output = element.querySelector("output");
    this.picture = document.querySelector("#film .picture");
    this.labels = document.querySelector("#film .labels");
    this.caption = document.querySelector("#film figcaption span");
    this.drawn = document.querySelector("#film input");
    this.slider.max = this.track.end;
    this.slider.addEventListener("input", () => { this.play(false); this.go(Number(this.slider.value)); });
    this.button.addEventListener("click", () => this.play(!this.playing));
    if (this.drawn) this.drawn.addEventListener("change", () => this.go(this.wanted));
  }

  // What is played from now on, from where it stood: { end, wanted, film, set }
  follow(track) {
    this.play(false);
    this.track = track;
    this.slider.max = track.end;
    this.go(track.wanted);
  }

  get wanted() { return this.track.wanted; }

  // Where there is a film, the scene stands at the time of the picture beside it
  go(time) {
    this.track.wanted = Math.min(Math.max(time, 0), this.track.end);
    const frame = this.track.film ? this.frame() : null;
    this.time = frame ? frame.time : this.wanted;
    this.slider.value = this.wanted;
    this.output.textContent = `${this.time.toFixed(2)} s`;
    this.track.set(this.time);
  }

  play(on) {
    this.playing = on;
    this.button.textContent = on ? "❚❚" : "▶";
    this.button.setAttribute("aria-label", on ? "pause" : "play");
    if (!on) return;
    let before = performance.now();
    const step = (now) => {
      if (!this.playing) return;
      const next = this.wanted + (now - before) / 1000;
      before = now;
      this.go(next > this.track.end ? 0 : next);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // Labels are drawn on the very frames that have them: with labels the film goes from one of these to the next
  frame() {
    const frames = this.drawn && this.drawn.checked && this.labelled.length ? this.labelled : this.film;
    if (!frames.length) return null;
    const frame = frames[last(frames.map((f) => f.time), this.wanted)];
    const labels = this.drawn.checked && frame.labels;
    if (this.picture.src !== frame.image) this.picture.src = frame.image;
    this.labels.style.display = labels ? "block" : "none";
    if (labels) this.labels.src = frame.labels;
    this.caption.textContent = `frame ${frame.frame}, ${frame.time.toFixed(2)} s`;
    return frame;
  }
}
