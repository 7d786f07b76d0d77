// The solids of a scene as clouds of points in the world: their hull is what is seen from the side.
import type { Cube, Entity, Pose, Scene, Vector } from "../contract";

const ROUND = 20; // points of a circle

/** A point of a solid's own frame, in the world. */
export function placed({ position, orientation: { x, y, z, w } }: Pose, point: Vector): Vector {
  // v + 2 w (r x v) + 2 r x (r x v)
  const cx = y * point.z - z * point.y, cy = z * point.x - x * point.z, cz = x * point.y - y * point.x;
  return {
    x: position.x + point.x + 2 * (w * cx + y * cz - z * cy),
    y: position.y + point.y + 2 * (w * cy + z * cx - x * cz),
    z: position.z + point.z + 2 * (w * cz + x * cy - y * cx),
  };
}

const SIGNS = [-0.5, 0.5];
const CORNERS: Vector[] = SIGNS.flatMap((x) => SIGNS.flatMap((y) => SIGNS.map((z) => ({ x, y, z }))));
const circle = (z: number, scale: number): Vector[] =>
  Array.from({ length: ROUND }, (_, i) => {
    const angle = (2 * Math.PI * i) / ROUND;
    return { x: (scale * Math.cos(angle)) / 2, y: (scale * Math.sin(angle)) / 2, z };
  });
const BALL = [-0.45, -0.3, 0, 0.3, 0.45].flatMap((z) => circle(z, 2 * Math.sqrt(0.25 - z * z))).concat([{ x: 0, y: 0, z: -0.5 }, { x: 0, y: 0, z: 0.5 }]);

const cloud = (solid: Cube, points: Vector[]) =>
  points.map(({ x, y, z }) => placed(solid.pose, { x: x * solid.size.x, y: y * solid.size.y, z: z * solid.size.z }));

export interface Solid {
  points: Vector[];
  colour: { r: number; g: number; b: number; a: number };
}

export function solids({ cubes = [], spheres = [], cylinders = [] }: Entity): Solid[] {
  return [
    ...cubes.map((one) => ({ points: cloud(one, CORNERS), colour: one.color })),
    ...spheres.map((one) => ({ points: cloud(one, BALL), colour: one.color })),
    ...cylinders.map((one) => ({ points: cloud(one, [...circle(-0.5, one.bottom_scale), ...circle(0.5, one.top_scale)]), colour: one.color })),
  ];
}

export const entity = (scene: Scene, id: string) => scene.entities.find((one) => one.id === id);

export class Box {
  low = { x: Infinity, y: Infinity, z: Infinity };
  high = { x: -Infinity, y: -Infinity, z: -Infinity };

  add(point: Vector) {
    for (const axis of ["x", "y", "z"] as const) {
      this.low[axis] = Math.min(this.low[axis], point[axis]);
      this.high[axis] = Math.max(this.high[axis], point[axis]);
    }
  }
  size = (axis: "x" | "y" | "z") => Math.max(0, this.high[axis] - this.low[axis]);
  middle = (axis: "x" | "y" | "z") => (this.high[axis] + this.low[axis]) / 2;
}

/** What the eye follows: the room that the robot has moved in, unless it walks away. Then the robot itself. */
export class Gaze {
  private room = new Box();

  follow(scene: Scene): Box | null {
    const robot = entity(scene, "robot");
    if (!robot) return null;
    const now = new Box();
    for (const solid of solids(robot)) solid.points.forEach((point) => now.add(point));
    if (!Number.isFinite(now.low.x)) return null;
    this.room.add(now.low);
    this.room.add(now.high);
    const length = Math.max(now.size("x"), now.size("y"), now.size("z"));
    for (const axis of ["x", "y"] as const) {
      if (this.room.size(axis) <= 3 * length) continue;
      this.room.low[axis] = now.middle(axis) - length;
      this.room.high[axis] = now.middle(axis) + length;
    }
    return this.room;
  }
}
