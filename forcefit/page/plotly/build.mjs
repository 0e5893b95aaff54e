// Creates plotly.min.js.gz, which contains only the trace types used by page.js and charts.py.
//
//     npm install && npm run build
//
// The size decreases from 4.9 MB to 1.8 MB, and the parsing time from 1.4 s to 0.4 s.
import { writeFileSync } from "node:fs";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";
import { environmentPlugin } from "esbuild-plugin-environment";
import { glsl } from "esbuild-plugin-glsl";
import css from "esbuild-plugin-inline-css";

const TRACES = ["bar", "heatmap", "scatter3d", "mesh3d", "cone"]; // scatter is in the core
const required = TRACES.map(name => `require("plotly.js/lib/${name}")`).join(", ");
const { outputFiles } = await build({
  stdin: {
    contents: `const Plotly = require("plotly.js/lib/core");
      Plotly.register([${required}]);
      module.exports = Plotly;`,
    resolveDir: ".",
  },
  bundle: true, minify: true, write: false, format: "iife", globalName: "Plotly",
  banner: { js: "/* plotly.js 3.7.0, MIT: see LICENSE */" }, legalComments: "eof",
  // plugins of esbuild-config.js in plotly.js
  plugins: [css(), glsl({ minify: true }), environmentPlugin({ NODE_DEBUG: false })],
  alias: { stream: "stream-browserify" },
  define: { global: "window", "define.amd": "false" },
  target: "es2020",
});
writeFileSync("plotly.min.js.gz", gzipSync(outputFiles[0].contents, { level: 9 }));
