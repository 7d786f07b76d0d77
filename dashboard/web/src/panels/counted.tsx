import type { calibration_status_t, controller_status_t, estimator_status_t } from "../messages";
import { Counters, type Names } from "../parts/counters";
import { Panel } from "../parts/panel";
import { calibrations, controller, estimator } from "../run";

const ESTIMATOR: Names<estimator_status_t> = [
  ["measurements used", "measurements"], ["refused", "refused", "bad"], ["came twice", "duplicates"], ["out of order", "reordered", "bad"], ["restarts", "restarts"], ["outages of joints", "outages", "bad"],
  ["IMU readings used", "imu_readings"], ["IMU readings refused", "imu_refused", "bad"], ["that came twice", "imu_duplicates"], ["that were out of order", "imu_reordered"], ["restarts of the model's filter", "model_restarts", "bad"],
];
const CONTROLLER: Names<controller_status_t> = [["episodes given up", "episodes_aborted", "bad"]];
const CALIBRATOR: Names<calibration_status_t> = [
  ["transitions dropped: gaps", "dropped_gap"], ["late", "dropped_late"], ["not finite", "dropped_not_finite", "bad"], ["over a restart", "dropped_restart"], ["states by the model", "dropped_model_based"],
];

export function CountedPanel() {
  const e = estimator.value, c = controller.value;
  const calibration = calibrations.value[calibrations.value.length - 1];
  return (
    <Panel id="counted" size="full" title="What else was counted" empty={!e && !c && !calibration && "Nothing has been counted yet."}
      what="What the other processes have counted since their start: readings and transitions that could not be used, and why, are normal at restarts of a filter and where a run begins.">
      {e && <><h4>Estimator</h4><Counters channel="ESTIMATOR_STATUS" message={e} names={ESTIMATOR} /></>}
      {c && <><h4>Controller</h4><Counters channel="CONTROLLER_STATUS" message={c} names={CONTROLLER} /></>}
      {calibration && <><h4>Calibrator</h4><Counters channel="CALIBRATION_STATUS" message={calibration} names={CALIBRATOR} /></>}
    </Panel>
  );
}
