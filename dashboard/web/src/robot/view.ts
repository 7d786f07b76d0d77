import type { Scene } from "../contract";

/** A picture of the robot on a canvas. */
export interface View {
  draw(scene: Scene): void;
  close(): void;
}

/** What /robot.js offers. @param colour of style/colours.css, as CSS has it. @param slow: it may be drawn without a graphics
 * processor, which takes more time than the rest of the page. Throws where there is no WebGL, or only such a one. */
export type OpenView = (canvas: HTMLCanvasElement, colour: (name: string) => string, slow: boolean) => View;
