import { signal } from "@preact/signals";

export type Theme = "auto" | "light" | "dark";
const KEY = "plumbline-theme";

function remembered(): Theme {
  try {
    const kept = localStorage.getItem(KEY);
    return kept === "light" || kept === "dark" ? kept : "auto";
  } catch {
    return "auto"; // a browser that keeps nothing
  }
}

export const theme = signal<Theme>(remembered());
/** Counts the changes of colours: what is drawn on a canvas is drawn anew. */
export const colours = signal(0);
const known = new Map<string, string>();

function apply() {
  document.documentElement.dataset["theme"] = theme.value;
  known.clear();
  colours.value++;
}

export function chooseTheme(choice: Theme) {
  theme.value = choice;
  try {
    localStorage.setItem(KEY, choice);
  } catch {
    // it lasts as long as the page
  }
  apply();
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
apply();

/** The colour that a custom property of style/colours.css has now, as a canvas wants it, with an opacity if asked for. */
export function colour(name: string, opacity = 1): string {
  let found = known.get(name);
  if (!found) {
    const probe = document.createElement("i");
    probe.style.color = `var(--${name})`;
    document.documentElement.append(probe);
    found = getComputedStyle(probe).color;
    probe.remove();
    known.set(name, found);
  }
  const [r, g, b] = found.match(/[\d.]+/g) ?? ["128", "128", "128"];
  return opacity === 1 ? found : `rgba(${r}, ${g}, ${b}, ${opacity})`;
}
