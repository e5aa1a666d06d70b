// Bundles src/ and three.js into the one script that the package ships, with the licence of three.js beside it.
// `node build.mjs FOLDER` writes it elsewhere, for the test that compares.
import { copyFileSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const folder = process.argv[2] ?? join(here, "../weathercoat/output/viewer");
const require = createRequire(join(here, "package.json"));
const esbuild = require("esbuild");
const three = resolve(dirname(require.resolve("three")), "..");
const { version } = JSON.parse(readFileSync(join(three, "package.json"), "utf8"));

await esbuild.build({
  entryPoints: [join(here, "src/main.js")],
  outfile: join(folder, "viewer.js"),
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "ascii", // a page may be read in any encoding
  legalComments: "none",
  nodePaths: [dirname(three)],
  banner: { js: `/* weathercoat viewer, with three.js ${version}, (c) its authors, MIT licence: see THREE-LICENSE.txt */` },
});
copyFileSync(join(three, "LICENSE"), join(folder, "THREE-LICENSE.txt"));
