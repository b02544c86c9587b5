// The checks of arguments. `docs.web.build` appends this file to engine.js. The ranges and their texts are those of Python.

const OPTIONS = { mode: "pic", dt: null, fix: null, spins: null, inPlay: null, maxTime: null, maxEvents: 10_000_000, physics: {} };
const STRIKE = { speed: undefined, heading: undefined, side: 0, top: 0, elevation: 0 };
const BALLS = ["positions", "velocities", "spins"], WIDTHS = [2, 2, 3];

/** The text of a value in an error. */
function short(value) {
  if (typeof value === "string") return `'${value}'`;
  if (Array.isArray(value)) return `[${value.map(short).join(", ")}]`;
  return value && typeof value === "object" ? JSON.stringify(value) : String(value);
}

function refuse(name, value, expected, when = "") {
  throw new RangeError(`${name} = ${short(value)}${when}: expected ${expected}`);
}

function oneOf(name, value, choices) {
  if (!choices.includes(value)) refuse(name, value, `one of ${choices.map(short).join(", ")}`);
}

const isNumber = value => typeof value === "number" && Number.isFinite(value);

/** Whether a value is in a range: the smallest and the largest number, the text of the error, whether it is whole. */
const fits = (value, [least, most, , whole]) => isNumber(value) && value >= least && value <= most && (!whole || Number.isInteger(value));

function inRange(name, value, range, when = "") {
  if (!fits(value, range)) refuse(name, value, range[2], when);
}

/** The values of an object by name, with default values for those that are missing. */
function checkedKeys(name, value, defaults) {
  if (!value || typeof value !== "object") refuse(name, value, "an object");
  Object.keys(value).forEach(key => oneOf(`key of ${name}`, key, Object.keys(defaults)));
  return Object.fromEntries(Object.entries(defaults).map(([key, usual]) => [key, value[key] ?? usual]));
}

function checkedOptions(options, ranges, fixes) {
  const all = checkedKeys("options", options, OPTIONS), { mode, dt, fix, maxTime, maxEvents } = all;
  oneOf("mode", mode, ["pic", "pit"]);
  if (mode === "pit") inRange("dt", dt, ranges.dt, " with mode='pit'");
  else if (dt !== null) refuse("dt", dt, "null, PIC has no timestep (mode='pit' has one)", " with mode='pic'");
  else if (fix !== null) refuse("fix", fix, "null, PIC has no overlaps to fix", " with mode='pic'");
  if (fix !== null) oneOf("fix", fix, fixes);
  if (maxTime !== null) inRange("maxTime", maxTime, ranges.maxTime);
  inRange("maxEvents", maxEvents, ranges.maxEvents);
  return all;
}

/** The numbers of the engine that follow from changes of `Physics`, with the rules of `Physics` of Python. */
function checkedNumbers({ physics, formulas, cushion }, changes, ranges) {
  checkedKeys("physics", changes, physics);
  for (const name in changes) inRange(`physics.${name}`, changes[name], ranges[name]);
  const all = { ...physics, ...changes }, { e_cushion, e_cushion_floor, cushion_frequency_ratio: ratio } = all;
  if (e_cushion_floor > e_cushion) refuse("physics.e_cushion_floor", e_cushion_floor, `at most e_cushion = ${e_cushion}`);
  const name = all.e_cushion_loss ? "e_cushion_floor" : "e_cushion", least = (Math.sqrt(1 + 8 / ratio ** 2) - 1) / 2;
  if (cushion === "stronge" && all[name] < least) {
    const expected = `at least ${Number(least.toPrecision(4))} for cushion_frequency_ratio ${ratio}, so that friction adds no energy`;
    refuse(`physics.${name}`, all[name], expected, " with physics.cushion = 'stronge'");
  }
  const value = form => Array.isArray(form) ? value(form[0]) * value(form[1]) : all[form] ?? form;
  return Object.fromEntries(Object.entries(formulas).map(([key, form]) => [key, value(form)]));
}

/** The parameters of a strike, in the order of `STRIKE`. */
function checkedStrike(strike, ranges) {
  const all = checkedKeys("strike", strike, STRIKE);
  for (const name in all) inRange(name, all[name], ranges[name]);
  if (Math.hypot(all.side, all.top) > 1) refuse("(side, top)", [all.side, all.top], "an offset of at most 1 ball radius");
  return Object.values(all);
}

/** The positions, velocities, spins and flags of balls as lists of numbers. */
function checkedBalls({ motion }, positions, velocities, spins, inPlay) {
  const count = positions?.length, playing = inPlay ?? Array(count).fill(true);
  const lists = [positions, velocities, spins ?? []].map((values, k) => ofBalls(BALLS[k], values, count, WIDTHS[k]));
  if (playing.length !== count || !playing.every(one => typeof one === "boolean")) refuse("inPlay", inPlay, `true or false for each of ${count} balls`);
  if (motion !== "sliding" && lists[2].some(Boolean)) refuse("spins", spins, "null, spins need motion 'sliding'", ` with physics.motion = '${motion}'`);
  return [...lists, playing.map(Number)];
}

/** A list of numbers for each ball. Velocities and spins may be one list, that of the cue ball, and spins may be empty. */
function ofBalls(name, values, count, width) {
  const isRow = row => row?.length === width && typeof row !== "string" && Array.from(row).every(isNumber);
  const listed = name !== "positions" && isRow(values) ? [values] : values;
  const fewer = name === "spins" ? [0, 1] : name === "velocities" ? [1] : [];
  if (!count || !Array.isArray(listed) || ![count, ...fewer].includes(listed.length) || !listed.every(isRow)) {
    refuse(name, values, `${width} finite numbers for each of ${count} balls`);
  }
  return Array.from({ length: count }, (_, i) => Array.from(listed[i] ?? Array(width).fill(0))).flat();
}

/** Checks the velocities and spins in arguments of an engine. */
function checkMotion([, ...motion], ranges) {
  for (const [k, name] of [[0, "velocities"], [1, "spins"]]) {
    const { content } = motion[k], width = WIDTHS[k + 1], ball = Math.floor(content.findIndex(value => !fits(value, ranges[name])) / width);
    if (ball >= 0) refuse(`${name}[${ball}]`, content.slice(ball * width, (ball + 1) * width), ranges[name][2]);
  }
}
