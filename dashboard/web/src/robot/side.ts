// The scene from the side, on a plain canvas: for browsers without WebGL, and for who likes it so.
import type { Scene } from "../contract";
import { colour } from "../theme";
import { entity, Gaze, solids, type Solid } from "./solids";
import type { View } from "./view";

type Point = [across: number, up: number];

/** Andrew's monotone chain. */
function hull(points: Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const turns = (o: Point, a: Point, b: Point) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  const half = (order: Point[]) => {
    const chain: Point[] = [];
    for (const point of order) {
      while (chain.length > 1 && turns(chain[chain.length - 2]!, chain[chain.length - 1]!, point) <= 0) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

export function sideView(canvas: HTMLCanvasElement): View {
  const pen = canvas.getContext("2d")!;
  const gaze = new Gaze();

  return {
    draw(scene: Scene) {
      const width = canvas.clientWidth, height = canvas.clientHeight, dense = devicePixelRatio;
      if (canvas.width !== width * dense || canvas.height !== height * dense) {
        canvas.width = width * dense;
        canvas.height = height * dense;
      }
      pen.setTransform(dense, 0, 0, dense, 0, 0);
      pen.clearRect(0, 0, width, height);
      const room = gaze.follow(scene);
      if (!room) return;
      const axis = room.size("x") >= room.size("y") ? "x" : "y";
      const scale = Math.min(width / (room.size(axis) + 0.3), height / (room.size("z") + 0.3)) * 0.92;
      const to = (across: number, up: number): Point => [width / 2 + (across - room.middle(axis)) * scale, height / 2 - (up - room.middle("z")) * scale];

      if (entity(scene, "ground")) {
        pen.fillStyle = colour("grid");
        const [, level] = to(0, 0);
        pen.fillRect(0, level, width, Math.max(0, height - level));
      }
      const paint = ({ points, colour: { r, g, b, a } }: Solid) => {
        const outline = hull(points.map((point) => to(point[axis], point.z)));
        pen.beginPath();
        outline.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath();
        pen.fillStyle = `rgba(${r * 255}, ${g * 255}, ${b * 255}, ${a})`;
        pen.strokeStyle = colour("ink", Math.min(a, 0.6));
        pen.fill();
        pen.stroke();
      };
      for (const id of ["robot", "prediction"]) {
        const found = entity(scene, id);
        if (found) solids(found).forEach(paint);
      }
    },
    close() {},
  };
}
