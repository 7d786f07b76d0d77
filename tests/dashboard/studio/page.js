// Foxglove Studio as a page of ours: its App with what it wants of a page kept in memory, and one layout.
const SETTINGS = { colorScheme: "light", "time.format": "RELATIVE", timezone: "UTC", "telemetry.telemetryEnabled": false, "ui.open-dialog-startup": false, launchPreference: "web" };
const FOLLOWED = { followTf: "robot", topics: { PLUMB_SCENE: { visible: true } }, cameraState: { distance: 5, perspective: true, phi: 75, targetOffset: [0, 0, 0.6], target: [0, 0, 0], targetOrientation: [0, 0, 0, 1], thetaOffset: 20, fovy: 45, near: 0.05, far: 500 } };
const LAYOUT = {
  configById: {
    "3D!a": FOLLOWED,
    "RawMessages!b": { topicPath: "ROBOT_STATE", diffEnabled: false, diffMethod: "previous message", diffTopicPath: "", showFullMessageForDiff: false, expansion: "all" },
    "RawMessages!d": { topicPath: "PLUMB_POSTERIOR", diffEnabled: false, diffMethod: "previous message", diffTopicPath: "", showFullMessageForDiff: false, expansion: "none" },
    "Plot!c": { paths: [{ value: "ROBOT_STATE.q[0]", enabled: true, timestampMethod: "receiveTime" }], showXAxisLabels: true, showYAxisLabels: true, showLegend: true, legendDisplay: "floating", showPlotValuesInLegend: false, isSynced: true, xAxisVal: "timestamp", sidebarDimension: 240 },
  },
  globalVariables: {}, userNodes: {}, playbackConfig: { speed: 1 },
  layout: { direction: "row", first: { direction: "column", first: "3D!a", second: "Plot!c", splitPercentage: 55 }, second: { direction: "column", first: "RawMessages!b", second: "RawMessages!d", splitPercentage: 55 }, splitPercentage: 55 },
};

const settings = new Map(Object.entries(SETTINGS)), listeners = new Map();
const appConfiguration = {
  get: (key) => settings.get(key),
  set: async (key, value) => {
    settings.set(key, value);
    for (const listener of listeners.get(key) ?? []) listener(value);
  },
  addChangeListener: (key, listener) => listeners.set(key, (listeners.get(key) ?? new Set()).add(listener)),
  removeChangeListener: (key, listener) => listeners.get(key)?.delete(listener),
};
const layouts = new Map([["ours", { id: "ours", name: "ours", permission: "CREATOR_WRITE", baseline: { data: LAYOUT, savedAt: new Date().toISOString() } }]]);
const layoutStorage = {
  list: async () => [...layouts.values()],
  get: async (_, id) => layouts.get(id),
  put: async (_, layout) => (layouts.set(layout.id, layout), layout),
  delete: async (_, id) => void layouts.delete(id),
  importLayouts: async () => {},
  migrateUnnamespacedLayouts: async () => {},
};
localStorage.setItem("studio.profile-data", JSON.stringify({ currentLayoutId: "ours" }));
await self.initI18n?.();
const dataSources = [new self.FoxgloveWebSocketDataSourceFactory(), new self.RemoteDataSourceFactory()];
self.ReactDOM.render(self.React.createElement(self.App, { deepLinks: [location.href], appConfiguration, dataSources, layoutStorage, extensionLoaders: [], enableGlobalCss: true }), document.getElementById("root"));
