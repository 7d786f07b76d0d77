#pragma once

namespace plumb {

/// The report's colours and layout. Prior and posterior differ in lightness, too: for those who do
/// not see colours. A constant: thread-safe.
inline constexpr char kReportStyle[] = R"(
:root { color-scheme: light dark; --paper: #ffffff; --card: #f5f7fa; --ink: #1b2330;
  --muted: #5b6676; --rule: #d8dee6;
  --grid: #e8ecf1; --prior: #c26a12; --posterior: #1f5fbf; --soft: #1f5fbf40; --band: #1f5fbf22;
  --good: #1a7f47; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --paper: #12161c; --card: #1b2129; --ink: #e4e9f0;
  --muted: #9aa6b5;
  --rule: #333d49; --grid: #262e38; --prior: #f0a75e; --posterior: #72b1ff; --soft: #72b1ff50;
  --band: #72b1ff2a; --good: #5fcf92;
  --bad: #ff8a80; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.55 system-ui,
  "Segoe UI", Helvetica, Arial, sans-serif; }
main { max-width: 1000px; margin: 0 auto; padding: 28px 20px 60px; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 4px; }
h2 { font-size: 1.2rem; margin: 44px 0 8px; padding-top: 14px; border-top: 1px solid var(--rule); }
h3 { font-size: 0.95rem; margin: 18px 0 2px; }
p { margin: 6px 0 12px; max-width: 75ch; overflow-wrap: anywhere; }
.sub, .note, figcaption { color: var(--muted); font-size: 0.9rem; }
.verdicts { display: grid; gap: 10px; grid-template-columns: repeat(auto-fit, minmax(min(100%,
  430px), 1fr)); margin: 20px 0; }
.verdict { background: var(--card); border-left: 4px solid var(--rule); border-radius: 4px;
  padding: 10px 14px; overflow-wrap: anywhere; }
.verdict b { display: block; }
.verdict.good { border-color: var(--good); } .verdict.good b { color: var(--good); }
.verdict.bad { border-color: var(--bad); } .verdict.bad b { color: var(--bad); }
.scroll { overflow-x: auto; margin: 10px 0; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 5px 16px 5px 0; border-bottom: 1px solid var(--rule);
  vertical-align: top; }
th { color: var(--muted); font-weight: 600; white-space: nowrap; }
td.n { white-space: nowrap; } td.words { min-width: 15em; }
figure { margin: 12px 0; }
figcaption { max-width: 80ch; margin-top: 4px; }
.panels { display: flex; flex-wrap: wrap; gap: 6px 18px; }
pre { background: var(--card); padding: 10px 14px; border-radius: 4px; white-space: pre-wrap;
  overflow-wrap: anywhere; font-size: 0.85rem; }
.key { display: inline-block; width: 0.8em; height: 0.8em; border-radius: 2px; 
  margin: 0 0.3em 0 0; }
.key.prior { background: var(--prior); } .key.posterior { background: var(--posterior); }
.key.reference { background: var(--ink); }
svg.plot { max-width: 100%; height: auto; display: block; }
.scroll > svg.plot { max-width: none; }
svg text { font: 12px system-ui, "Segoe UI", Helvetica, Arial, sans-serif; fill: var(--ink); }
svg text.tick { font-size: 11px; fill: var(--muted); }
svg text.muted { fill: var(--muted); } svg text.large { font-size: 15px; }
.frame { fill: none; stroke: var(--rule); } .grid { fill: none; stroke: var(--grid); }
.axis { stroke: var(--muted); }
.limit { fill: none; stroke: var(--muted); stroke-dasharray: 3 4; }
.line { fill: none; stroke-width: 1.5; } .line.thick { stroke-width: 2.2; }
.prior.line { stroke: var(--prior); stroke-dasharray: 5 3; }
.posterior.line { stroke: var(--posterior); }
.reference.line { stroke: var(--ink); stroke-width: 1.2; }
.dots { fill: none; stroke: var(--posterior); stroke-opacity: 0.4; stroke-width: 2.4;
  stroke-linecap: round; }
.dots.strong { stroke-opacity: 1; stroke-width: 4; }
.posterior.bar { fill: var(--soft); stroke: var(--posterior); stroke-width: 0.6; }
.posterior.mark { fill: var(--posterior); } .prior.mark { fill: var(--prior); }
.band { fill: var(--band); }
@media print { :root { --paper: #ffffff; --ink: #000000; } h2 { break-after: avoid; }
  figure { break-inside: avoid; } }
)";

}  // namespace plumb
