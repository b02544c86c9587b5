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
const TYPES = { f8: Float64Array, i8: BigInt64Array, i4: Int32Array, b1: Uint8Array };

const EVENT_WIDTH = 9, PIECE_WIDTH = 14;  // columns of the log, see `engine/log.py`

const rows = (flat, width) => Array.from({ length: flat.length / width }, (_, k) => [...flat.subarray(k * width, (k + 1) * width)]);
const isNumber = value => typeof value === "number" && Number.isFinite(value);

/** An array as an argument of a compiled function. `content` is a typed array or a list of numbers. */
class Argument {
  constructor(type, shape, content) {
    this.type = type;
    this.shape = shape;
    this.content = content;
    this.size = TYPES[type].BYTES_PER_ELEMENT;
    this.length = shape.reduce((product, side) => product * side, 1);
  }

  /** Puts the array in the memory of the module. */
  place(exports) {
    this.memory = exports.memory;
    this.pointer = exports.allocate(this.size * this.length);
    if (this.content) this.read().set(this.content);
  }

  /** The array in the memory of the module. The next call of a function overwrites it. */
  read() {
    return new TYPES[this.type](this.memory.buffer, this.pointer, this.length);
  }

  /** The fields of an array of numba: two owners, numbers of items and of bytes of one, data, sides, steps in bytes. */
  fields() {
    const steps = this.shape.map((_, k) => this.shape.slice(k + 1).reduce((product, side) => product * side, this.size));
    return [0, 0, BigInt(this.length), BigInt(this.size), this.pointer, ...this.shape.map(BigInt), ...steps.map(BigInt)];
  }
}

/** The numbers of a scene, one record of `Numbers` of `physics/state.py`. */
class Numbers extends Argument {
  constructor(numbers, integers) {
    const names = Object.keys(numbers);
    super("f8", [1], null);
    this.size = 8 * names.length;
    this.entries = names.map(name => [integers.includes(name), numbers[name]]);
  }

  place(exports) {
    this.pointer = exports.allocate(this.size);
    const view = new DataView(exports.memory.buffer, this.pointer);
    this.entries.forEach(([integer, value], k) => {
      if (integer) view.setBigInt64(8 * k, BigInt(value), true);
      else view.setFloat64(8 * k, Number(value), true);
    });
  }
}

/** Calls a compiled function. A tuple is a list, None is null. Returns the array with its result. */
function call(exports, name, values) {
  exports.reset();
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

/** The fields of a scene as arguments. */
function asArguments(value) {
  if (value === null) return null;
  if (value === true) return 1;
  if (Array.isArray(value)) return value.map(asArguments);
  return new Argument(value.type, value.shape, value.content.map(value.type === "i8" ? BigInt : Number));
}

/** Returns the first balls of an array of radii or of inverse masses. */
function cut(value, count) {
  if (value === null) return null;
  if (count > value.content.length) throw new RangeError(`positions has ${count} balls: expected at most ${value.content.length}`);
  return { ...value, shape: [count], content: value.content.slice(0, count) };
}

/** Returns a list of numbers for each ball. One list is that of the cue ball. */
function ofBalls(name, values, count, width) {
  const given = values == null ? [] : Array.isArray(values[0]) ? values : [values];
  const all = Array.from({ length: count }, (_, i) => given[i] ?? (given.length <= 1 ? Array(width).fill(0) : []));
  if (given.length > count || !all.every(row => row.length === width && row.every(isNumber))) {
    throw new TypeError(`${name} = ${JSON.stringify(values)}: expected ${width} finite numbers for each of ${count} balls`);
  }
  return all.flat();
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
    this.#log = log;
    this.#pieces = pieces;
    this.#kinds = kinds;
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
    if (!isNumber(time) || time < 0) throw new RangeError(`time = ${time}: expected a finite number of seconds >= 0`);
    return this.paths.map((_, ball) => this.motion(ball, time)).map(({ x, y }) => [x, y]);
  }
}

/** The engines of one WebAssembly module. */
class Engine {
  constructor(exports, data) {
    this.exports = exports;
    this.data = data;
    this.kept = {};
  }

  /** The names of the scenes. */
  get scenes() {
    return Object.keys(this.data.scenes);
  }

  scene(name) {
    const scene = this.data.scenes[name];
    if (!scene) throw new RangeError(`scene = ${name}: expected one of ${this.scenes.join(", ")}`);
    return scene;
  }

  /** The arguments of a scene with a number of balls. `changes` replace its numbers. */
  fields(scene, count, changes = {}) {
    const [{ content, integers }, radius, inverse, pockets, outline, spheres, ...laws] = this.scene(scene).fields;
    const unknown = Object.keys(changes).find(name => !(name in content));
    if (unknown) throw new RangeError(`number ${unknown}: expected one of ${Object.keys(content).join(", ")}`);
    const key = `${scene} ${count}`, numbers = new Numbers({ ...content, ...changes }, integers);
    const kept = this.kept[key] ??= asArguments([cut(radius, count), cut(inverse, count), pockets, outline, cut(spheres, count), ...laws]);
    return [numbers, ...kept];
  }

  starts(positions, velocities, { spins, inPlay }) {
    const n = positions.length, playing = inPlay ?? Array(n).fill(true);
    if (playing.length !== n) throw new TypeError(`inPlay = ${JSON.stringify(inPlay)}: expected true or false for each of ${n} balls`);
    return [
      new Argument("f8", [1, n, 2], ofBalls("positions", positions, n, 2)),
      new Argument("f8", [1, n, 2], ofBalls("velocities", velocities, n, 2)),
      new Argument("f8", [1, n, 3], ofBalls("spins", spins, n, 3)),
      new Argument("b1", [1, n], playing.map(Number)),
    ];
  }

  /** Whether balls lie on the table, outside the pockets and apart, and their velocities and spins are in range. */
  isValid(scene, positions, velocities = [0, 0], options = {}) {
    const starts = this.starts(positions, velocities, options), { kind } = this.scene(scene);
    const result = call(this.exports, `valid_${kind}`, [0n, 1n, this.fields(scene, positions.length), ...starts]);
    return (result.read()[0] & 255) === 1;
  }

  /** The velocity and the spin that a cue gives a ball that touches no other, and whether the tip slips. */
  strike(scene, { speed, heading, side = 0, top = 0, elevation = 0 }) {
    const { cue } = this.scene(scene), parameters = [speed, heading, side, top, elevation];
    if (!cue) throw new RangeError(`scene = ${scene}: expected a scene whose balls slide, a strike gives spin`);
    if (!parameters.every(isNumber) || Math.hypot(side, top) > 1) {
      throw new RangeError(`strike = ${parameters}: expected finite numbers, and an offset (side, top) of at most 1 ball radius`);
    }
    const out = [new Argument("f8", [1, 2]), new Argument("f8", [1, 3]), new Argument("b1", [1])];
    call(this.exports, "strike", [...cue, new Argument("f8", [1, 5], parameters), ...out]);
    const [velocity, spin, miscue] = out.map(array => [...array.read()]);
    return { velocity, spin, miscue: miscue[0] === 1 };
  }

  /**
   * Runs a shot until every ball rests.
   *
   * scene: its name; positions: [[x, y], ...]; velocities: for each ball, or of the cue ball alone.
   * Options: mode "pic" (exact) or "pit" (fixed timestep dt, and fix), spins, inPlay, maxTime, maxEvents and numbers,
   * an object that replaces numbers of the scene, such as {e_ball: 1}.
   */
  simulate(scene, positions, velocities, options = {}) {
    const { mode = "pic", dt = null, fix = null, maxEvents = 10_000_000, numbers = {} } = options;
    const { kind, max_time } = this.scene(scene), n = positions.length, { fixes, kinds, status } = this.data;
    if (mode !== "pic" && mode !== "pit") throw new RangeError(`mode = ${mode}: expected "pic" or "pit"`);
    if ((mode === "pit") !== (isNumber(dt) && dt > 0)) throw new RangeError(`dt = ${dt}: expected a timestep in s for "pit", none for "pic"`);
    if (fix !== null && !fixes.includes(fix)) throw new RangeError(`fix = ${fix}: expected one of ${fixes.join(", ")}`);
    if (!this.isValid(scene, positions, velocities, options)) {
      throw new RangeError("positions: expected balls that lie on the table, outside the pockets and apart, with speeds in range");
    }
    const changes = { ...numbers, ...(mode === "pit" ? { dt, fix: fixes.indexOf(fix ?? fixes[0]) } : {}) };
    for (let room = 256; ; room *= 4) {
      const out = (type, ...shape) => new Argument(type, shape);
      const starts = this.starts(positions, velocities, options), used = new Argument("i8", [3], [0n, 0n, 0n]);
      const results = [out("f8", 1), out("i4", 1, n), out("i4", 1, n), out("i8", 1), out("i8", 1), out("i8", 1), out("i8", 1)];
      const log = [out("f8", room, EVENT_WIDTH), out("f8", 4 * room, PIECE_WIDTH), used, out("i8", 0, 2)];
      const limit = options.maxTime ?? max_time ?? Infinity;
      call(this.exports, `${mode}_${kind}`, [0n, 1n, this.fields(scene, n, changes), limit, BigInt(maxEvents), starts, results, log]);
      const [nEvents, nSegments] = [...used.read()].map(Number);
      if (nEvents > room || nSegments > 4 * room) continue;  // the log was too small: the shot runs again
      const [balls, speeds, turns, playing] = starts.map(array => array.read());
      const [time, cushions, before, events, ended, first, rule] = results.map(array => array.read());
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
        spinDecay: this.scene(scene).fields[0].content.spin_decay,
      }, log[0].read().slice(0, nEvents * EVENT_WIDTH), log[1].read().slice(0, nSegments * PIECE_WIDTH), kinds);
    }
  }
}

/** Loads the engines. `source` is a response, the promise of one, or the bytes of engine.wasm. */
export async function load(source) {
  const given = await source, bytes = given instanceof Response ? await given.arrayBuffer() : given;
  const module = await WebAssembly.compile(bytes), [section] = WebAssembly.Module.customSections(module, "billiards");
  const { exports } = await WebAssembly.instantiate(module);
  return new Engine(exports, JSON.parse(new TextDecoder().decode(section)));
}
