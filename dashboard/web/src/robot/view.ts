import type { Scene } from "../contract";

/** A picture of the robot on a canvas. */
export interface View {
  draw(scene: Scene): void;
  close(): void;
}

/** What /robot.js offers. @param colour of style/colours.css, as CSS has it. Throws where there is no WebGL. */
export type OpenView = (canvas: HTMLCanvasElement, colour: (name: string) => string) => View;
