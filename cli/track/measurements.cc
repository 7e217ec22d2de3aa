// SPDX-License-Identifier: Apache-2.0
#include "cli/track/measurements.h"

#include <nlohmann/json.hpp>

#include "base/units.h"

namespace veneer::cli {
namespace {

using nlohmann::ordered_json;
using tracking::EyeOffset;
using tracking::Latency;
using tracking::MotionSignal;

constexpr double kMilli = 1e3;

ordered_json list_of(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

ordered_json verdict_of(const Status& good) {
  ordered_json json{{"good", good.has_value()}};
  if (!good) json["why"] = good.error().what;
  return json;
}

}  // namespace

std::string line_of(const EyeOffset& offset) {
  return fmt::format(
      "turned {:.0f}, {:.0f}, {:.0f} degrees; eye within {:.2f} mm (rms), {:.2f} mm held out; "
      "offset within {:.2f} mm; {} poses, {} outliers",
      offset.span_deg[0],
      offset.span_deg[1],
      offset.span_deg[2],
      kMilli * offset.residual_m,
      kMilli * offset.held_out_m,
      kMilli * offset.deviation_m(),
      offset.used,
      offset.outliers);
}

std::string text_of(const EyeOffset& offset, const Status& good) {
  if (!good) return line_of(offset) + "\n" + good.error().what;
  const Eigen::Vector3d& eye = offset.eye_in_sensor;
  return fmt::format(
      "{}\neye_in_sensor = [{:.5f}, {:.5f}, {:.5f}]", line_of(offset), eye.x(), eye.y(), eye.z());
}

ordered_json json_of(const EyeOffset& offset, const Status& good) {
  ordered_json json = verdict_of(good);
  if (good) {
    json["eye_in_sensor"] = list_of(offset.eye_in_sensor);
    json["eye_in_world"] = list_of(offset.eye_in_world);
  }
  json["deviation_mm"] = kMilli * offset.deviation_m();
  json["residual_mm"] = kMilli * offset.residual_m;
  json["held_out_mm"] = kMilli * offset.held_out_m;
  json["span_deg"] = list_of(offset.span_deg);
  json["poses"] = offset.used;
  json["outliers"] = offset.outliers;
  return json;
}

std::string text_of(const Latency& latency, const Status& good) {
  const bool by_position = latency.signal == MotionSignal::kPosition;
  const double scale = by_position ? kMilli : to_degrees(Radians{1}).value;
  const std::string found = fmt::format(
      "by {} over {:.1f} s: the motions agree within {:.3g} {} (rms), {:.3g} at the worst latency",
      name_of(latency.signal),
      latency.seconds,
      scale * latency.residual,
      by_position ? "mm" : "degrees",
      scale * latency.worst_residual);
  if (!good) return found + "\n" + good.error().what;
  return fmt::format(
      "{}\nknown to {:.3f} ms; add to the latency_ms of the [tracker] recorded:\n"
      "latency_ms = {:.3f}",
      found,
      kMilli * latency.deviation_s,
      kMilli * latency.latency_s);
}

ordered_json json_of(const Latency& latency, const Status& good) {
  ordered_json json = verdict_of(good);
  if (good) json["latency_ms"] = kMilli * latency.latency_s;
  json["deviation_ms"] = kMilli * latency.deviation_s;
  json["signal"] = name_of(latency.signal);
  // Millimetres for positions, degrees for rotations.
  const bool by_position = latency.signal == MotionSignal::kPosition;
  const double scale = by_position ? kMilli : to_degrees(Radians{1}).value;
  json[by_position ? "residual_mm" : "residual_deg"] = scale * latency.residual;
  json[by_position ? "worst_residual_mm" : "worst_residual_deg"] = scale * latency.worst_residual;
  json["seconds"] = latency.seconds;
  return json;
}

}  // namespace veneer::cli
