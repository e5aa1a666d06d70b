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
const SEVERITY = {
  rusted_percent: "Rusted",
  flaked_percent: "Flaked",
  cracked_percent: "Cracked",
  lifted_percent: "Lifted",
  runoff_percent: "Stained by rust",
  dirt_percent: "Dirty",
  "grades.iso_4628_3": "as ISO 4628-3, rust",
  "grades.iso_4628_5": "as ISO 4628-5, flaking",
  "grades.astm_d610": "as ASTM D610, rust",
  "patches.count": "Bare patches",
  "patches.largest_length": "Longest patch",
  "rust_patches.count": "Rust patches",
  "cracks.length": "Cracks",
  "cracks.density": "Crack density",
  "junctions.count": "Crack junctions",
  "junctions.median_angle": "Median angle",
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
  const add = (parent, rows, name, text) => {
    const values = rows.map((row) => row[name]);
    const row = parent.appendChild(document.createElement("div"));
    row.className = "figure";
    const label = row.appendChild(document.createElement("span"));
    label.textContent = text;
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
  const addGroup = (parent, all, labels) => {
    const rows = all.map((each) => flatten(each));
    for (const [name, text] of Object.entries(labels)) {
      if (rows.some((row) => name in row)) add(parent, rows, name, text);
    }
  };
  addGroup(body, snapshots.map(({ figures }) => figures), LABELS);
  const severity = snapshots.map((snapshot) => snapshot.severity);
  const addSeverity = (title, of, isOpen) => {
    const all = severity.map(of);
    if (!all.some(Boolean)) return;
    const details = body.appendChild(document.createElement("details"));
    details.open = isOpen;
    details.appendChild(document.createElement("summary")).textContent = title;
    addGroup(details, all, SEVERITY);
  };
  addSeverity("Severity", (each) => each.whole, true);
  for (const kind of ["groups", "parts"]) {
    const names = new Set(severity.flatMap((each) => Object.keys(each[kind] ?? {})));
    for (const name of names) addSeverity(`Severity: ${name}`, (each) => each[kind]?.[name], false);
  }
  return (i) => updates.forEach((update) => update(i));
}
