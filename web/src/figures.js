// The run's figures: a row each, with its value at the moment that is shown and a small curve over age.

const LABELS = {
  separated_share: "Separated",
  lost_share: "Lost",
  affected_share: "Affected",
  crack_length: "Crack length",
  outline_length: "Outline length",
  "flakes.count": "Flakes",
  "flakes.median_area": "Median flake area",
  "flakes.largest_area": "Largest flake area",
  substrate_rust: "Rust of the metal",
  film_rust: "Rust on the film",
  dust: "Dirt",
};
const [WIDTH, HEIGHT] = [88, 22];

/** Numbers and texts of nested figures by dotted name; lists are left out. */
export function flatten(figures, prefix = "") {
  const rows = {};
  for (const [name, value] of Object.entries(figures ?? {})) {
    if (typeof value === "number" || typeof value === "string") rows[prefix + name] = value;
    else if (value && typeof value === "object" && !Array.isArray(value)) {
      Object.assign(rows, flatten(value, `${prefix}${name}.`));
    }
  }
  return rows;
}

function labelOf(name) {
  if (LABELS[name]) return LABELS[name];
  const words = name.replace(/_(percent|share)$/, "").replaceAll("_", " ").split(".");
  return words.map((word, i) => (i ? word : word.charAt(0).toUpperCase() + word.slice(1))).join(" \u00b7 ");
}

function format(name, value) {
  if (typeof value === "string") return value;
  if (/_share$/.test(name)) return `${(100 * value).toFixed(1)}\u202f%`;
  if (/percent$/.test(name)) return `${value.toPrecision(3)}\u202f%`;
  return Number.isInteger(value) ? value.toLocaleString("en") : Number(value.toPrecision(3)).toString();
}

function curve(ages, values) {
  const numbers = values.map((value) => (typeof value === "number" ? value : 0));
  const [low, high] = [Math.min(0, ...numbers), Math.max(...numbers)];
  const [first, last] = [ages[0], ages.at(-1)];
  const x = (age) => 3 + ((WIDTH - 6) * (age - first)) / (last - first || 1);
  const y = (value) => HEIGHT - 3 - ((HEIGHT - 6) * (value - low)) / (high - low || 1);
  return { points: numbers.map((value, i) => [x(ages[i]), y(value)]) };
}

/** Fills `body` with groups of rows; returns what shows the values of snapshot i. */
export function makeFigures(body, snapshots) {
  const ages = snapshots.map((snapshot) => snapshot.age);
  const updates = [];
  const add = (parent, rows, name) => {
    const values = rows.map((row) => row[name]);
    const row = parent.appendChild(document.createElement("div"));
    row.className = "figure";
    const label = row.appendChild(document.createElement("span"));
    label.textContent = labelOf(name);
    const value = document.createElement("output");
    let dot = null;
    if (snapshots.length > 1 && values.some((each) => typeof each === "number")) {
      const { points } = curve(ages, values);
      row.insertAdjacentHTML(
        "beforeend",
        `<svg viewBox="0 0 ${WIDTH} ${HEIGHT}" aria-hidden="true"><polyline points="${points
          .map((point) => point.map((x) => x.toFixed(1)).join(","))
          .join(" ")}"/><circle r="2.6"/></svg>`,
      );
      dot = { circle: row.querySelector("circle"), points };
    } else row.appendChild(document.createElement("i"));
    row.appendChild(value);
    updates.push((i) => {
      value.textContent = values[i] === undefined ? "\u2013" : format(name, values[i]);
      dot?.circle.setAttribute("cx", dot.points[i][0]);
      dot?.circle.setAttribute("cy", dot.points[i][1]);
    });
  };
  const whole = snapshots.map(({ figures }) => flatten(figures));
  for (const name of Object.keys(LABELS)) if (whole.some((row) => name in row)) add(body, whole, name);
  const severity = snapshots.map(({ severity }) => severity ?? {});
  const groups = [...new Set(severity.flatMap((each) => Object.keys(each)))];
  const loose = groups.filter((name) => severity.some((each) => typeof each[name] !== "object"));
  for (const name of [null, ...groups.filter((name) => !loose.includes(name))]) {
    const rows = severity.map((each) =>
      flatten(name === null ? Object.fromEntries(loose.map((key) => [key, each[key]])) : each[name]),
    );
    const names = [...new Set(rows.flatMap((row) => Object.keys(row)))];
    if (!names.length) continue;
    const group = body.appendChild(document.createElement("details"));
    group.open = name === null || name === "whole";
    const title = group.appendChild(document.createElement("summary"));
    title.textContent = name === null || name === "whole" ? "Severity" : labelOf(name);
    for (const each of names) add(group, rows, each);
  }
  return (i) => updates.forEach((update) => update(i));
}
