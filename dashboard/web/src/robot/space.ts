// The scene in three dimensions, to be turned by hand: /robot.js, loaded when it is looked at.
import {
  AmbientLight, BoxGeometry, BufferGeometry, Color, CylinderGeometry, DirectionalLight, GridHelper, Group, HemisphereLight, Mesh, MeshStandardMaterial,
  PCFShadowMap, PerspectiveCamera, PlaneGeometry, Scene as Stage, ShadowMaterial, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Cube, Cylinder, Entity, Scene } from "../contract";
import { entity, Gaze } from "./solids";
import type { OpenView } from "./view";

const FAR = 2.3; // sizes of the robot's room between it and the camera
const BALL = new SphereGeometry(0.5, 32, 20);
const CUBE = new BoxGeometry(1, 1, 1);
const tubes = new Map<string, BufferGeometry>();

function tube({ bottom_scale, top_scale }: Cylinder): BufferGeometry {
  const key = `${bottom_scale} ${top_scale}`;
  let found = tubes.get(key);
  if (!found) {
    // Along z, as Foxglove has it.
    found = new CylinderGeometry(top_scale / 2, bottom_scale / 2, 1, 32).rotateX(Math.PI / 2);
    tubes.set(key, found);
  }
  return found;
}

/** One entity: its solids are made once, and then moved. */
class Body {
  readonly group = new Group();

  show(shown: Entity | undefined) {
    this.group.visible = shown !== undefined;
    if (!shown) return;
    const wanted: [BufferGeometry, Cube][] = [
      ...(shown.cubes ?? []).map((one): [BufferGeometry, Cube] => [CUBE, one]),
      ...(shown.spheres ?? []).map((one): [BufferGeometry, Cube] => [BALL, one]),
      ...(shown.cylinders ?? []).map((one): [BufferGeometry, Cube] => [tube(one), one]),
    ];
    while (this.group.children.length > wanted.length) this.group.remove(this.group.children[this.group.children.length - 1]!);
    wanted.forEach(([geometry, { pose, size, color }], i) => {
      let mesh = this.group.children[i] as Mesh<BufferGeometry, MeshStandardMaterial> | undefined;
      if (!mesh) this.group.add((mesh = new Mesh(geometry, new MeshStandardMaterial({ roughness: 0.55, metalness: 0.05 }))));
      mesh.geometry = geometry;
      mesh.material.color.setRGB(color.r, color.g, color.b, "srgb");
      mesh.material.opacity = color.a;
      mesh.material.transparent = color.a < 1;
      mesh.material.depthWrite = color.a >= 1;
      mesh.castShadow = color.a >= 1;
      mesh.position.set(pose.position.x, pose.position.y, pose.position.z);
      mesh.quaternion.set(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w);
      mesh.scale.set(size.x || 1e-3, size.y || 1e-3, size.z || 1e-3);
    });
  }
}

/** Whether the browser draws without a graphics processor. */
function byProcessor(renderer: WebGLRenderer): boolean {
  const gl = renderer.getContext();
  const told = gl.getExtension("WEBGL_debug_renderer_info");
  return /swiftshader|llvmpipe|software/i.test(String(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER)));
}

export const open: OpenView = (canvas, colour, slow) => {
  const renderer = new WebGLRenderer({ canvas, antialias: !slow, alpha: true });
  if (!slow && byProcessor(renderer)) {
    renderer.dispose();
    throw new Error("no graphics processor");
  }
  renderer.shadowMap.enabled = !slow;
  renderer.shadowMap.type = PCFShadowMap;
  const stage = new Stage();
  const camera = new PerspectiveCamera(32, 1, 0.01, 500);
  camera.up.set(0, 0, 1);
  const controls = new OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.maxPolarAngle = Math.PI * 0.53;

  const sun = new DirectionalLight(0xffffff, 2.4);
  sun.castShadow = true;
  sun.shadow.mapSize.set(1024, 1024);
  sun.shadow.bias = -0.001;
  stage.add(new HemisphereLight(0xffffff, 0x667080, 1.5), new AmbientLight(0xffffff, 0.35), sun, sun.target);
  const ground = new Group();
  const shade = new Mesh(new PlaneGeometry(200, 200), new ShadowMaterial({ opacity: 0.22, depthWrite: false }));
  shade.receiveShadow = true;
  let grid: GridHelper | null = null;
  let gridColour = "";
  const robot = new Body();
  const prediction = new Body();
  ground.add(shade);
  stage.add(ground, robot.group, prediction.group);

  const gaze = new Gaze();
  const middle = new Vector3();
  let far = 0; // of the camera, from what it looks at; 0: it has no place yet
  let turned = false; // by hand: from then on the camera is the person's
  controls.addEventListener("start", () => (turned = true));
  let last: Scene | null = null;

  function lookAt(scene: Scene) {
    const room = gaze.follow(scene);
    if (!room) return;
    const size = Math.max(room.size("x"), room.size("y"), room.size("z"), 0.1);
    middle.set(room.middle("x"), room.middle("y"), room.middle("z"));
    const flat = room.size("x") >= room.size("y");
    if (!turned && size * FAR > far) {
      far = size * FAR;
      controls.target.copy(middle);
      camera.position.set(middle.x + far * (flat ? 0.34 : 0.9), middle.y - far * (flat ? 0.9 : 0.34), middle.z + far * 0.26);
    } else {
      const moved = middle.clone().sub(controls.target).multiplyScalar(0.15);
      controls.target.add(moved);
      camera.position.add(moved);
    }
    // Where there is no ground, a floor below shows how it stands.
    ground.position.set(Math.round(middle.x), Math.round(middle.y), entity(scene, "ground") ? 0 : room.low.z - 0.15 * size);
    const reach = size * 2;
    sun.target.position.copy(middle);
    sun.position.set(middle.x + reach * 0.5, middle.y - reach * 0.6, middle.z + reach);
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.01, far: reach * 4 });
    sun.shadow.camera.updateProjectionMatrix();
  }

  function paint() {
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    const dense = Math.min(devicePixelRatio, 2);
    if (canvas.width !== Math.floor(width * dense) || canvas.height !== Math.floor(height * dense)) {
      renderer.setPixelRatio(dense);
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
    }
    if (gridColour !== colour("rule")) {
      gridColour = colour("rule");
      if (grid) ground.remove(grid);
      grid = new GridHelper(40, 80, new Color(gridColour), new Color(gridColour));
      grid.rotateX(Math.PI / 2);
      ground.add(grid);
    }
    controls.update();
    renderer.render(stage, camera);
  }
  controls.addEventListener("change", () => requestAnimationFrame(() => last && renderer.render(stage, camera)));

  return {
    draw(scene) {
      last = scene;
      robot.show(entity(scene, "robot"));
      prediction.show(entity(scene, "prediction"));
      lookAt(scene);
      paint();
    },
    close() {
      controls.dispose();
      renderer.dispose();
    },
  };
};
