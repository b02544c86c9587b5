// The mixture of Gaussians of a trained `AimPolicy` for a layout. The policy plays velocities. It has the activation "relu"
// and no goal, waves, paths or own_std.

const CIRCLE = 0.05, MOST_INVERSE = 10;  // as in billiards_env/sb3/aim_network.py

// Returns the function (positions, inPlay) => components [{ weight, dx, dy, speed, along, across }], the largest weight first.
// `shapes` are the shapes of the weights by name, in the order in which `numbers` holds them. Positions are those of
// the observation, from -1 to 1.
export function policyOf(shapes, numbers) {
  const weights = {};
  let begin = 0;
  for (const [name, shape] of Object.entries(shapes)) {
    const size = shape.reduce((product, length) => product * length, 1);
    weights[name] = numbers.subarray(begin, begin += size);
  }
  const { half_extents: half, slowest, faster, std, first_points: first } = weights, points = first.length / 2;
  const split = shapes["choice.0.weight"][0];
  const linear = (name, x) => {
    const matrix = weights[`${name}.weight`], bias = weights[`${name}.bias`], rows = matrix.length / x.length;
    return Float32Array.from({ length: rows }, (_, i) => {
      let sum = bias ? bias[i] : 0;
      for (let j = 0; j < x.length; j++) sum += matrix[i * x.length + j] * x[j];
      return sum;
    });
  };
  const relu = x => x.map(number => Math.max(0, number)), plus = (a, b) => b ? a.map((number, i) => number + b[i]) : a;
  const layers = (name, x, added) => linear(`${name}.4`, relu(linear(`${name}.2`, relu(plus(linear(`${name}.0`, x), added)))));

  // The components that aim at ball k, with their logits.
  function aimedAt(k, positions, inPlay) {
    const signs = positions[k].map(number => number < 0 ? -1 : 1);
    const places = positions.map(place => place.map((number, axis) => signs[axis] * number));
    const between = (a, b) => places[b].map((number, axis) => (number - places[a][axis]) * half[axis]);
    const toBall = between(0, k), distance = Math.max(Math.hypot(...toBall), 1e-6), [ux, uy] = toBall.map(number => number / distance);
    let total = null;
    for (let other = 1; other < positions.length; other++) {
      if (other === k || !inPlay[other]) continue;
      const [x, y] = between(0, other), near = 1 / (Math.hypot(...between(k, other)) + 0.1);
      const one = relu(linear("other_ball.2", relu(linear("other_ball.0", [...places[other], x * ux + y * uy, y * ux - x * uy, near]))));
      total = plus(one, total);
    }
    const choice = layers("choice", [...places[0], ...places[k], ux, uy, distance, 1 / (distance + 0.1)], total && linear("other_balls", total).subarray(0, split));
    const offset = layers("points", places[k]);
    return Array.from(slowest, (slow, c) => {
      const p = c % points, x = toBall[0] + first[p] + CIRCLE * offset[p], y = toBall[1] + first[points + p] + CIRCLE * offset[points + p];
      const inverse = 1 / Math.sqrt(x * x + y * y + 1e-9), speed = slow + faster[c] / (1 + Math.exp(-choice[slowest.length + c]));
      return { logit: choice[c], dx: signs[0] * x * inverse, dy: signs[1] * y * inverse, speed, along: std[0], across: speed * std[1] * Math.min(inverse, MOST_INVERSE) };
    });
  }
  return (positions, inPlay) => {
    const all = positions.flatMap((_, k) => k && inPlay[k] ? aimedAt(k, positions, inPlay) : []);
    const largest = Math.max(...all.map(one => one.logit)), total = all.reduce((sum, one) => sum + Math.exp(one.logit - largest), 0);
    return all.map(({ logit, ...one }) => ({ weight: Math.exp(logit - largest) / total, ...one })).sort((a, b) => b.weight - a.weight);
  };
}

// Returns `count` actions [x, y] of a mixture: the means of the largest weights, then as many random ones. `random` draws from [0, 1).
export function proposals(mixture, count, random = Math.random) {
  const actionOf = ({ dx, dy, speed }, ahead = 0, aside = 0) => [(speed + ahead) * dx - aside * dy, (speed + ahead) * dy + aside * dx];
  const actions = mixture.slice(0, Math.ceil(count / 2)).map(one => actionOf(one));
  while (actions.length < count) {
    let rest = random();
    const one = mixture.find(({ weight }) => (rest -= weight) < 0) ?? mixture[0], far = Math.sqrt(-2 * Math.log(1 - random())), angle = 2 * Math.PI * random();
    actions.push(actionOf(one, far * Math.cos(angle) * one.along, far * Math.sin(angle) * one.across));
  }
  return actions.map(action => action.map(number => Math.min(1, Math.max(-1, number))));
}
