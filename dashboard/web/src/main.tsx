import { render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Controls, Outcome, stop } from "./controls";
import { Header, helping, Warning } from "./header";
import { BusPanel } from "./panels/bus";
import { ChannelsPanel } from "./panels/channels";
import { CountedPanel } from "./panels/counted";
import { EventsPanel } from "./panels/events";
import { FanPanel } from "./panels/fan";
import { GapPanel } from "./panels/gap";
import { MotionPanel } from "./panels/motion";
import { PairsPanel } from "./panels/pairs";
import { PosteriorPanel } from "./panels/posterior";
import { CyclePanel, ProcessesPanel } from "./panels/processes";
import { ReturnsPanel } from "./panels/returns";
import { RobotPanel } from "./panels/robot";
import { TrainingPanel } from "./panels/trpo";
import { UpdatePanel } from "./panels/update";
import { listen } from "./run";

const SECTIONS: [id: string, name: string, panels: (() => preact.JSX.Element)[]][] = [
  ["now", "Robot", [RobotPanel, MotionPanel]],
  ["learnt", "Learning", [PosteriorPanel, PairsPanel, FanPanel, UpdatePanel, GapPanel]],
  ["policies", "Policies", [ReturnsPanel, TrainingPanel]],
  ["health", "Health", [ProcessesPanel, CyclePanel, BusPanel, CountedPanel, ChannelsPanel]],
  ["history", "Events", [EventsPanel]],
];

const go = (id: string) => {
  const section = document.getElementById(id);
  section?.scrollIntoView({ block: "start" });
  section?.focus({ preventScroll: true });
};

function pressed(key: KeyboardEvent) {
  if (key.key === "Escape") return stop();
  if (key.ctrlKey || key.metaKey || key.altKey || key.target instanceof HTMLInputElement) return;
  const section = SECTIONS[Number(key.key) - 1];
  if (section) go(section[0]);
  if (key.key === "?") helping.value = !helping.value;
}

function Help() {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current!.showModal(), []);
  const keys: [string, string][] = [["Esc", "emergency stop, always"], ...SECTIONS.map(([, name], i): [string, string] => [String(i + 1), name]), ["?", "these keys"]];
  return (
    <dialog ref={dialog} onClose={() => (helping.value = false)} aria-labelledby="help-title">
      <h2 id="help-title">Keys</h2>
      <dl class="keys">{keys.map(([key, what]) => <div key={key}><dt><kbd>{key}</kbd></dt><dd>{what}</dd></div>)}</dl>
      <p class="buttons"><button onClick={() => (helping.value = false)}>Close</button></p>
    </dialog>
  );
}

function Page() {
  return (
    <>
      <Header />
      <Outcome />
      <Warning />
      <nav aria-label="Sections">{SECTIONS.map(([id, name]) => <a key={id} href={`#${id}`}>{name}</a>)}</nav>
      <Controls />
      <main>
        {SECTIONS.map(([id, name, panels]) => (
          <section class="group" key={id} id={id} tabIndex={-1} aria-label={name}>
            <h2>{name}</h2>
            <div class="panels">{panels.map((Panel, i) => <Panel key={i} />)}</div>
          </section>
        ))}
      </main>
      {helping.value && <Help />}
    </>
  );
}

// Before a dialog takes the key to close itself.
document.addEventListener("keydown", pressed, { capture: true });
const start = () => {
  listen();
  render(<Page />, document.getElementById("page")!);
};
// The bar of index.html is painted first; a tab that nobody looks at paints nothing.
if (document.hidden) start();
else requestAnimationFrame(() => setTimeout(start));
