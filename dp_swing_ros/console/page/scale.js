// Copyright 2026 the dp_swing_ros authors
// SPDX-License-Identifier: Apache-2.0
// From a slider's place (0 to 1) to a parameter's value and back: linear, or by decades.

const DECADES = 100;   // from this ratio of the ends on a slider goes by decades

/**
 * Return the ends of a slider: the parameter's own where they are near, else around its default,
 * else those of the default bodies, `times` as large.
 */
function ends({minimum, maximum, value, default: usual, type, times = 1}) {
  const size = Math.max(Math.abs(usual || 0), Math.abs(value || 0));
  const guess = size > 0 ? 10 * size : type.startsWith('integer') ? 10 : times;
  let low = minimum ?? -guess, high = maximum ?? Math.max(guess, 2 * low);
  if (high > 100 * guess) high = guess;
  if (low < -100 * guess) low = -guess;
  return [Math.min(low, value ?? low), Math.max(high, value ?? high)];
}

/** Return {to: place => value, from: value => place} for a parameter's numbers. */
export function scaleOf(parameter) {
  const [low, high] = ends(parameter), whole = parameter.type.startsWith('integer');
  const tidy = value => whole ? Math.round(value) : Number(value.toPrecision(3));
  const span = high - low || 1;
  const linear = low < 0 || !(high / Math.max(low, 1e-12) > DECADES) || parameter.maximum === 1 && low === 0;
  if (linear) {
    return {to: place => tidy(low + place * span), from: value => (value - low) / span};
  }
  // by decades from the smallest of interest, and zero, if it is allowed, at the very end
  const usual = Math.abs(parameter.default || parameter.value || high / 10);
  const least = low > 0 ? Math.max(low, high * 1e-6) : Math.min(usual, high) / 1000;
  const range = Math.log(high / least);
  return {
    to: place => place <= 0 ? low : tidy(Math.max(least * Math.exp(place * range), low)),
    from: value => value <= least ? 0 : Math.log(value / least) / range};
}
