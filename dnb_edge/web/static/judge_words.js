// Laps, passes and standings in the words of the judge's page. Knows the API's JSON; knows no page.

/** A time with what it is worth: 6.535 s ± 1 ms. */
export function time(lap) {
  // As the board rounds it.
  const sigma = Math.max(1, Math.round(lap.sigma_s * 1000));
  return `${lap.time_s.toFixed(3)} s ± ${sigma} ms`;
}

/** What the lap counts as. */
export function official(lap) {
  const time_s = lap.official_time_s ?? lap.time_s;
  return lap.valid ? `${time_s.toFixed(3)} s` : "not valid";
}

/** All that was done to a lap, in a line for each: penalties, why it is not valid, why its numbers are doubted. */
export function reasons(one) {
  const lap = one.lap;
  const lines = lap.penalties.map((penalty) => `${cost(penalty)} for ${words(penalty.offence)}: ${penalty.reason}`);
  lines.push(...lap.reasons, ...lap.suspect.map((text) => `doubtful: ${text}`));
  if (one.raw.length === 0) lines.push("a judge added it");
  if (one.raw.length > 1) lines.push(`laps ${one.raw.map((lap_) => lap_.number).join(" and ")} of the race in one`);
  if (!one.counts) lines.push("removed");
  if (one.edits.length > 0) lines.push(`decision ${one.edits.join(", ")}`);
  return [...new Set(lines)];
}

/** The lap in one line, for a comparison. */
export function inShort(one) {
  if (one === null) return "none";
  const lap = one.lap;
  const parts = [time(lap)];
  if (lap.penalty_s > 0) parts.push(`+ ${plain(lap.penalty_s)} s = ${(lap.official_time_s ?? lap.time_s).toFixed(3)} s`);
  if (lap.penalty_factor !== 1) parts.push(`score × ${plain(lap.penalty_factor)}`);
  if (lap.penalties.some((penalty) => penalty.dnf)) parts.push("the car's race ends");
  if (!lap.valid) parts.push(`not valid: ${lap.reasons.join("; ")}`);
  return one.counts ? parts.join(", ") : `removed (${parts.join(", ")})`;
}

export function totals(side) {
  const best = side.best_s === null ? "" : `, best ${side.best_s.toFixed(3)} s`;
  return `${side.laps} ${side.laps === 1 ? "lap" : "laps"}, ${side.valid} valid${best}`;
}

/** A line of the standings. */
export function standing(row, unit) {
  const value = row.value === null ? "no result" : `${digits(row.value, unit)} ${unit}`;
  const end = row.dnf === null ? "" : `, did not finish: ${row.dnf}`;
  return `${row.place}${row.tied ? " (tied)" : ""}  ${row.name}  ${value}${end}`;
}

/** A value of the standings with as many digits as its unit is worth. */
export function digits(value, unit) {
  return unit === "laps" ? plain(value) : value.toFixed(unit === "percent" ? 2 : 3);
}

/** A pass in a word: what the race made of it. */
export function passMeaning(crossing) {
  if (crossing.reason !== null) return crossing.reason;
  const meanings = { start: "a lap began", lap: "a lap ended, the next began", arrived: "a lap ended", sector: "a sector ended" };
  return meanings[crossing.status] ?? "changed nothing";
}

/** A name of the API for people: off_track as off track. */
export function words(name) {
  return name.replaceAll("_", " ");
}

function cost(penalty) {
  const parts = [];
  if (penalty.seconds > 0) parts.push(`+ ${plain(penalty.seconds)} s`);
  if (penalty.factor !== 1) parts.push(`score × ${plain(penalty.factor)}`);
  if (penalty.invalid) parts.push("not valid");
  if (penalty.dnf) parts.push("race ended");
  return parts.join(", ") || "no cost";
}

function plain(number) {
  return String(Math.round(number * 1000) / 1000);
}
