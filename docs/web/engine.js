// The engines of billiards-env as a JavaScript module. It computes the same bits as Python.
//
//   import { load } from "./engine.js";
//   const engine = await load(fetch("engine.wasm"));
//   const shot = engine.simulate("pool", [[-0.6, 0], [0.6, 0.02]], [2, 0]);
//   shot.events;       // [{time, kind, ball, other, x, y, speed, rule}, ...]
//   shot.at(0.5);      // the positions at 0.5 s, [[x, y], ...]
//
// Units are m, s, m/s and rad/s. Ball 0 is the cue ball. `simulate` of Python documents the arguments and results.

const PHASES = { rest: 0, spinning: 1, rolling: 2, sliding: 3, free: 4, potted: 5 };
const TYPES = { f8: Float64Array, i8: BigInt64Array, i4: Int32Array, b1: Uint8Array, u1: Uint8Array };

const EVENT_WIDTH = 9, PIECE_WIDTH = 14;  // columns of the log, see `engine/log.py`

const rows = (flat, width) => Array.from({ length: flat.length / width }, (_, k) => [...flat.subarray(k * width, (k + 1) * width)]);

let uses = 0;  // how often the memory was reset; after each reset an array is placed once

/**
 * An array as an argument of a compiled function. `content` is a typed array or a list of numbers. `size` is the number
 * of bytes of an item: more than the type has for the items of records.
 */
class Argument {
  constructor(type, shape, content, size = TYPES[type].BYTES_PER_ELEMENT) {
    Object.assign(this, { type, shape, content, size });
    this.length = shape.reduce((product, side) => product * side, 1);
  }

  /** Puts the array in the memory of the module. */
  place(exports) {
    if (this.placed === uses) return;
    this.placed = uses;
    this.memory = exports.memory;
    this.pointer = exports.allocate(this.size * this.length);
    if (this.content) this.read().set(this.content);
  }

  /** The array in the memory of the module. It is valid until the next call of a function. */
  read() {
    return new TYPES[this.type](this.memory.buffer, this.pointer, this.length * this.size / TYPES[this.type].BYTES_PER_ELEMENT);
  }

  /** The fields of an array of numba: two owners, numbers of items and of bytes of one, data, sides, steps in bytes. */
  fields() {
    const steps = this.shape.map((_, k) => this.shape.slice(k + 1).reduce((product, side) => product * side, this.size));
    return [0, 0, BigInt(this.length), BigInt(this.size), this.pointer, ...this.shape.map(BigInt), ...steps.map(BigInt)];
  }
}

/** The numbers of a scene, one record of `Numbers` of `physics/state.py`. */
function record(numbers, integers) {
  const view = new DataView(new ArrayBuffer(8 * Object.keys(numbers).length));
  Object.entries(numbers).forEach(([name, value], k) => {
    if (integers.includes(name)) view.setBigInt64(8 * k, BigInt(value), true);
    else view.setFloat64(8 * k, Number(value), true);
  });
  return new Argument("u1", [1], new Uint8Array(view.buffer), view.byteLength);
}

function reset(exports) {
  exports.reset();
  uses += 1;
}

/** Calls a compiled function. A tuple is a list, None is null. Returns the array with its result. */
function call(exports, name, values) {
  const result = new Argument("i4", [4], [0, 0, 0, 0]);
  result.place(exports);
  const flat = [result.pointer, result.pointer + 8];
  const add = value => {
    if (Array.isArray(value)) value.forEach(add);
    else if (value instanceof Argument) { value.place(exports); flat.push(...value.fields()); }
    else flat.push(value ?? 0);
  };
  values.forEach(add);
  const status = exports[name](...flat);
  if (status !== 0) throw new Error(`${name}: the compiled function failed`);
  return result;
}

/** An array from the data of the module as an argument. */
const asArray = ({ type, shape, content }) => new Argument(type, shape, content.map(type === "i8" ? BigInt : Number));

/** A part of the data of the module as arguments. */
const asArguments = value => Array.isArray(value) ? value.map(asArguments) : value?.type ? asArray(value) : value;

/** Returns the first balls of an array of radii or of inverse masses. */
function cut(value, count) {
  if (count > value.content.length) throw new RangeError(`positions has ${count} balls: expected at most ${value.content.length}`);
  return { ...value, shape: [count], content: value.content.slice(0, count) };
}

/** The result of a shot: the balls at its end, its events and the motion between them. */
class Shot {
  #log;
  #pieces;
  #kinds;
  #events;
  #paths;

  constructor(fields, log, pieces, kinds) {
    Object.assign(this, fields);
    [this.#log, this.#pieces, this.#kinds] = [log, pieces, kinds];
  }

  /** The events, in their order: time, kind, ball, other, x, y, speed and rule. */
  get events() {
    return this.#events ??= rows(this.#log, EVENT_WIDTH).map(([time, , kind, ball, other, x, y, speed, rule]) => (
      { time, kind: this.#kinds[kind], ball, other, x, y, speed, rule: rule === 1 }));
  }

  /** The pieces of the path of each ball, in the order in which they begin; see `State.rows` of `physics/state.py`. */
  get paths() {
    if (!this.#paths) {
      this.#paths = this.positions.map(() => []);
      for (const [ball, phase, x, y, vx, vy, ax, ay, ux, uy, wz, t0, t0Low, lasts] of rows(this.#pieces, PIECE_WIDTH)) {
        this.#paths[ball].push({ phase, x, y, vx, vy, ax, ay, ux, uy, wz, t0, t0Low, lasts });
      }
    }
    return this.#paths;
  }

  /** The piece of a ball's path at a time, s. */
  piece(ball, time) {
    const pieces = this.paths[ball];
    let low = 0, high = pieces.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (pieces[middle].t0 <= time) low = middle; else high = middle - 1;
    }
    return pieces[low];
  }

  /** The motion of a ball at a time, s: position, velocity, angular velocity, and whether it is potted. */
  motion(ball, time, radius = 1) {
    if (!isNumber(time) || time < 0) refuse("time", time, "a finite number of seconds >= 0");
    if (!this.paths[ball]) refuse("ball", ball, `a whole number from 0 to ${this.paths.length - 1}`);
    const until = Math.min(time, this.time), piece = this.piece(ball, until), { phase } = piece;
    const since = (until - piece.t0) - piece.t0Low, within = Math.min(Math.max(since, 0), piece.lasts);
    const moves = phase >= PHASES.rolling && phase < PHASES.potted, t = moves ? within : 0;
    const x = piece.x + t * (piece.vx + 0.5 * t * piece.ax), y = piece.y + t * (piece.vy + 0.5 * t * piece.ay);
    const going = moves && since < piece.lasts, vx = going ? piece.vx + t * piece.ax : 0, vy = going ? piece.vy + t * piece.ay : 0;
    // The slip changes 7/2 times as fast as the velocity, until the ball rolls.
    const slides = going && phase === PHASES.sliding, ux = slides ? piece.ux + 3.5 * t * piece.ax : 0, uy = slides ? piece.uy + 3.5 * t * piece.ay : 0;
    const turns = Math.sign(piece.wz) * Math.max(0, Math.abs(piece.wz) - this.spinDecay * within);
    return { x, y, vx, vy, spin: [(uy - vy) / radius, (vx - ux) / radius, turns], potted: phase === PHASES.potted };
  }

  /** The positions of all balls at a time, s. A potted ball is at the centre of its pocket. */
  at(time) {
    return this.paths.map((_, ball) => this.motion(ball, time)).map(({ x, y }) => [x, y]);
  }
}

const fromBase64 = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));

/** The engines of one WebAssembly module. */
class Engine {
  constructor(exports, data) {
    Object.assign(this, { exports, data, kept: {} });
  }

  /** The names of the scenes. */
  get scenes() {
    return Object.keys(this.data.scenes);
  }

  scene(name) {
    oneOf("scene", name, this.scenes);
    return this.data.scenes[name];
  }

  /** The arguments of a scene with a number of balls. `changes` replace its numbers. */
  fields(scene, count, changes = {}) {
    const [{ content, integers }, radius, inverse, pockets, outline, ...others] = this.scene(scene).fields;
    const key = `${scene} ${count}`, numbers = record({ ...content, ...changes }, integers);
    const kept = this.kept[key] ??= asArguments([cut(radius, count), cut(inverse, count), pockets, outline, ...others]);
    return [numbers, ...kept];
  }

  starts(scene, positions, velocities, { spins, inPlay }) {
    const n = positions?.length, lists = checkedBalls(this.scene(scene), positions, velocities, spins, inPlay);
    const balls = ["f8", "f8", "f8", "b1"].map((type, k) => new Argument(type, k < 3 ? [1, n, WIDTHS[k]] : [1, n], lists[k]));
    return [...balls, new Argument("i8", [1], [0n]), null];  // ball 0 is the cue ball, and no ball flies
  }

  /** Whether balls lie on the table, outside the pockets and apart, and their velocities and spins are in range. */
  isValid(scene, positions, velocities = [0, 0], options = {}) {
    checkedKeys("options", options, { spins: null, inPlay: null });
    const starts = this.starts(scene, positions, velocities, options), { kind, kernels } = this.scene(scene);
    const fields = this.fields(scene, positions.length);
    reset(this.exports);
    return (call(this.exports, `valid_${kind}`, [kernels[0], 0n, 1n, fields, starts]).read()[0] & 255) === 1;
  }

  /** The velocity and the spin that a cue (m/s, rad, ball radii) gives a free ball, and whether the tip slips. */
  strike(scene, cueing) {
    const { cue, motion } = this.scene(scene);
    if (!cue) throw new RangeError(`strike with physics.motion = '${motion}': expected motion 'sliding', a strike gives spin`);
    const parameters = checkedStrike(cueing, this.data.ranges);
    const out = [new Argument("f8", [1, 2]), new Argument("f8", [1, 3]), new Argument("b1", [1])];
    reset(this.exports);
    call(this.exports, "strike", [...cue, new Argument("f8", [1, 5], parameters), ...out]);
    const [velocity, spin, miscue] = out.map(array => [...array.read()]);
    return { velocity, spin, miscue: miscue[0] === 1 };
  }

  /**
   * Runs a shot until every ball rests.
   *
   * scene: its name; positions: [[x, y], ...]; velocities: for each ball, or of the cue ball alone, or the result of
   * `strike`. In the last case the cue also drives balls that touch the cue ball.
   * Options: mode "pic" (exact) or "pit" (fixed timestep dt, and fix), spins, inPlay, maxTime, maxEvents and physics,
   * an object that replaces numbers of the scene, such as {e_ball: 1}. The names and ranges of the numbers are those of Python.
   */
  simulate(scene, positions, velocities, options = {}) {
    const { fixes, kinds, status, ranges } = this.data, { kind, kernels, max_time, cue } = this.scene(scene), n = positions?.length;
    const { mode, dt, fix, maxTime, maxEvents, physics, spins, inPlay } = checkedOptions(options, ranges, fixes), struck = velocities?.velocity;
    if (struck && spins) refuse("spins", spins, "null, the strike has a spin", " with a strike");
    const moving = struck ?? velocities, start = { spins: struck ? [velocities.spin] : spins, inPlay }, numbers = checkedNumbers(this.scene(scene), physics, ranges);
    checkMotion(this.starts(scene, positions, moving, start), ranges);
    if (!this.isValid(scene, positions, moving, start)) {
      throw new RangeError("positions: expected balls that lie on the table, outside the pockets and apart; a ball of infinite mass rests");
    }
    const changes = { ...numbers, ...(mode === "pit" ? { dt } : {}) }, suffix = mode === "pit" ? `_${fix ?? fixes[0]}` : "";
    for (let room = 256; ; room *= 4) {
      const out = (type, ...shape) => new Argument(type, shape);
      const starts = this.starts(scene, positions, moving, start), used = new Argument("i8", [3], [0n, 0n, 0n]);
      const results = [out("f8", 1), out("i4", 1, n), out("i4", 1, n), out("i8", 1), out("i8", 1), out("i8", 1), out("i8", 1),
        out("i4", 1, n), out("i4", 1, n), out("b1", 1, n), out("f8", 1)];
      const log = [out("f8", room, EVENT_WIDTH), out("f8", 4 * room, PIECE_WIDTH), used, out("i8", 0, 2)];
      const limit = maxTime ?? max_time ?? Infinity;
      reset(this.exports);
      if (struck) call(this.exports, `drive_${kind}`, [kernels[0], 0n, 1n, 0n, cue, this.fields(scene, n, numbers), starts]);
      call(this.exports, `${mode}_${kind}${suffix}`, [mode === "pic" ? kernels : kernels.slice(0, 1), 0n, 1n, this.fields(scene, n, changes), limit, BigInt(maxEvents), starts, [...results, null], log]);  // no measures
      const [nEvents, nSegments] = [...used.read()].map(Number);
      if (nEvents > room || nSegments > 4 * room) continue;  // the log was too small: the shot runs again
      const [balls, speeds, turns, playing] = starts.slice(0, 4).map(array => array.read());
      const [time, cushions, before, events, ended, first, rule, pockets, order, touched, firstTime] = results.map(array => array.read());
      return new Shot({
        positions: rows(balls, 2),
        velocities: rows(speeds, 2),
        spins: rows(turns, 3),
        potted: Array.from(playing, value => value === 0),
        time: time[0],
        cushions: [...cushions],
        cushionsBeforeHit: [...before],
        nEvents: Number(events[0]),
        status: status[ended[0]],
        firstHit: Number(first[0]),
        nContactRule: Number(rule[0]),
        pockets: [...pockets],
        potOrder: [...order],
        touchedFirst: Array.from(touched, value => value === 1),
        firstHitTime: firstTime[0],
        spinDecay: numbers.spin_decay,
      }, log[0].read().slice(0, nEvents * EVENT_WIDTH), log[1].read().slice(0, nSegments * PIECE_WIDTH), kinds);
    }
  }
}

/** Returns compressed bytes as the response of their content. */
const inflated = bytes => new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate")));

/** Loads the engines. `source` is a response, the promise of one, or the bytes of engine.wasm. */
export async function load(source) {
  const loaded = await source, bytes = loaded instanceof Response ? await loaded.arrayBuffer() : loaded;
  const module = await WebAssembly.compile(bytes), [section] = WebAssembly.Module.customSections(module, "billiards");
  const { exports } = await WebAssembly.instantiate(module);
  return new Engine(exports, await inflated(section).json());
}
