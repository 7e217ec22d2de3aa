// SPDX-License-Identifier: Apache-2.0
#include "capture/plan.h"

#include <cmath>
#include <numbers>

namespace veneer::capture {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::size_t kMostDirections = 10000;

btf::Direction on_arc(double degrees) {
  return {std::sin(degrees * kDegree), 0, std::cos(degrees * kDegree)};
}

/// `arc_deg` or `theta_phi_deg` of a table, whichever is there.
void read_directions(TomlReader& table, btf::DirectionSet& directions) {
  const bool arc = table.contains("arc_deg");
  if (arc && table.contains("theta_phi_deg"))
    table.add_error("arc_deg", "theta_phi_deg is there too; keep one of them");
  if (arc) {
    Eigen::Vector3d range{0, 0, 1};
    table.read("arc_deg", range);
    const double steps = (range[1] - range[0]) / range[2];
    if (!(range[2] > 0) || !(steps >= 0) || steps > static_cast<double>(kMostDirections) ||
        std::abs(steps - std::round(steps)) > 1e-6) {
      table.add_error("arc_deg",
                      "expected [first, last, step] with first <= last and a step above 0 that "
                      "leads from one to the other");
      return;
    }
    directions.clear();
    for (int i = 0; i <= static_cast<int>(std::round(steps)); ++i)
      directions.push_back(on_arc(range[0] + i * range[2]));
  }
  std::vector<Eigen::Vector2d> angles;
  table.read("theta_phi_deg", angles);
  if (arc || angles.empty()) return;
  directions.clear();
  for (const Eigen::Vector2d& each : angles) {
    // Beyond the horizon the sine of theta would come back on the other side.
    if (!(each[0] >= 0 && each[0] < 90)) {
      table.add_error("theta_phi_deg", fmt::format("theta is {}; it is in [0, 90)", each[0]));
      return;
    }
    directions.push_back(btf::direction_from_angles({each[0] * kDegree, each[1] * kDegree}));
  }
}

void read_light_source(TomlReader& table, CapturePlan& plan) {
  std::string from = "rig";
  table.read("from", from);
  if (from == "rig") {
    plan.light_source = LightSource::kRig;
  } else if (from == "mirror-ball") {
    plan.light_source = LightSource::kMirrorBall;
  } else if (from == "projector") {
    plan.light_source = LightSource::kProjector;
  } else {
    table.add_error("from",
                    fmt::format("\"{}\" is none of \"rig\", \"mirror-ball\", \"projector\"", from));
  }
  table.read("ball_radius_mm", plan.ball_radius_mm);
  table.read("profile", plan.profile);
  table.read("sample_position", plan.world_from_sample.translation);
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  table.read("sample_turn_deg", turn);
  if (const double angle = turn.norm(); angle > 0)
    plan.world_from_sample.rotation = Eigen::AngleAxisd(angle * kDegree, turn / angle);
}

Status out_of_range(std::string_view key, const std::string& value, std::string_view may_be) {
  return fail(Errc::kInvalidOption, "{} is {}; it must be {}", key, value, may_be);
}

/// `low` and `high` are allowed.
Status check_range(std::string_view key, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return out_of_range(key, fmt::format("{}", value), fmt::format("in [{}, {}]", low, high));
}
Status check_positive(std::string_view key, double value) {
  if (std::isfinite(value) && value > 0) return {};
  return out_of_range(key, fmt::format("{}", value), "above 0");
}
Status check_finite(std::string_view key, double value) {
  if (std::isfinite(value)) return {};
  return out_of_range(key, fmt::format("{}", value), "a finite number");
}

Status check_directions(std::string_view key, const btf::DirectionSet& directions) {
  if (directions.empty())
    return fail(Errc::kInvalidOption, "{} names no direction; give arc_deg or theta_phi_deg", key);
  if (directions.size() > kMostDirections)
    return out_of_range(key,
                        fmt::format("{} directions", directions.size()),
                        fmt::format("{} at most", kMostDirections));
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const btf::Direction& each = directions[i];
    if (!(std::abs(each.norm() - 1) < 1e-6) || !(each.z() > 1e-6))
      return fail(
          Errc::kInvalidOption,
          "{}: number {} is ({}, {}, {}); it must be a unit vector above the horizon, theta "
          "below 90 degrees",
          key,
          i,
          each.x(),
          each.y(),
          each.z());
  }
  if (const auto equal = btf::find_equal_directions(directions))
    return fail(Errc::kInvalidOption,
                "{}: numbers {} and {} are the same direction; leave one out",
                key,
                equal->first,
                equal->second);
  return {};
}

Status check_polarisation(const PolarisationAxes& axes) {
  if (!(std::abs(axes.axis.norm() - 1) < 1e-6))
    return out_of_range("polarisation.axis",
                        fmt::format("({}, {}, {})", axes.axis.x(), axes.axis.y(), axes.axis.z()),
                        "a vector that is not zero");
  const std::vector<double>& angles = axes.analyser_rad;
  if (angles.size() < 2 || angles.size() > 99)
    return out_of_range("polarisation.analyser_deg",
                        fmt::format("a list of {}", angles.size()),
                        "[0, 90], or three angles or more");
  // Angles of an axis: 180 degrees are none.
  const auto differ = [](double a, double b) { return std::abs(std::sin(a - b)); };
  constexpr double kLeast = kDegree / 10;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    VENEER_TRY(check_finite("polarisation.analyser_deg", angles[i] / kDegree));
    for (std::size_t k = 0; k < i; ++k) {
      if (differ(angles[i], angles[k]) < kLeast)
        return fail(Errc::kInvalidOption,
                    "polarisation.analyser_deg: {} and {} are the same position of the analyser",
                    angles[k] / kDegree,
                    angles[i] / kDegree);
    }
  }
  if (angles.size() == 2 &&
      (differ(angles[0], 0) > kLeast || differ(angles[1], std::numbers::pi / 2) > kLeast))
    return out_of_range("polarisation.analyser_deg",
                        fmt::format("[{}, {}]", angles[0] / kDegree, angles[1] / kDegree),
                        "[0, 90] (parallel, cross), or three angles or more");
  return {};
}

Status check_lens(const CameraLens& lens) {
  VENEER_TRY(check_positive("lens.focal_px", lens.focal_px.x()));
  VENEER_TRY(check_positive("lens.focal_px", lens.focal_px.y()));
  VENEER_TRY(check_finite("lens.principal_point", lens.principal_point.sum()));
  VENEER_TRY(check_finite("lens.k1", lens.k1));
  return check_finite("lens.k2", lens.k2);
}

Status check_lights(const CapturePlan& plan) {
  const bool projector = plan.light_source == LightSource::kProjector;
  if (projector && plan.profile.empty())
    return fail(Errc::kInvalidOption,
                "lights.from is \"projector\", but lights.profile does not say which profile");
  if (plan.light_source == LightSource::kMirrorBall)
    VENEER_TRY(check_positive("lights.ball_radius_mm", plan.ball_radius_mm));
  VENEER_TRY(check_finite("lights.sample_position", plan.world_from_sample.translation.sum()));
  if (!projector || !plan.lights.empty()) VENEER_TRY(check_directions("lights", plan.lights));
  if (!plan.mirror_light) return {};
  const auto lights = std::max<int>(static_cast<int>(plan.lights.size()), 1);
  if (*plan.mirror_light >= 0 && *plan.mirror_light < lights) return {};
  return out_of_range("mirror.light",
                      fmt::format("{}", *plan.mirror_light),
                      fmt::format("the number of a light, 0 to {}", lights - 1));
}

}  // namespace

CapturePlan CapturePlan::read(TomlReader& toml) {
  CapturePlan plan;
  TomlReader sample = toml.table("sample");
  sample.read("name", plan.name);
  sample.read("columns", plan.area.columns);
  sample.read("rows", plan.area.rows);
  sample.require("left_mm", plan.area.left_mm);
  sample.require("top_mm", plan.area.top_mm);
  sample.require("width_mm", plan.area.width_mm);
  sample.require("height_mm", plan.area.height_mm);
  sample.read("lift_mm", plan.area.lift_mm);

  TomlReader board = toml.table("board");
  board.read("columns", plan.board.columns);
  board.read("rows", plan.board.rows);
  board.read("square_mm", plan.board.square_mm);
  board.read("marker_mm", plan.board.marker_mm);
  board.read("dictionary", plan.board.dictionary);

  TomlReader polarisation = toml.table("polarisation");
  polarisation.read("axis", plan.polarisation.axis);
  if (const double length = plan.polarisation.axis.norm(); length > 0)
    plan.polarisation.axis /= length;
  if (polarisation.contains("analyser_deg")) {
    polarisation.read("analyser_deg", plan.polarisation.analyser_rad);
    for (double& angle : plan.polarisation.analyser_rad) angle *= kDegree;
  }

  TomlReader exposure = toml.table("exposure");
  exposure.read("step", plan.exposure.step);
  exposure.read("most", plan.exposure.most);
  exposure.read("frames", plan.exposure.frames);
  exposure.read("multiple_of_s", plan.exposure.multiple_of_s);

  TomlReader lights = toml.table("lights");
  read_light_source(lights, plan);
  read_directions(lights, plan.lights);
  plan.views = {btf::Direction(0, 0, 1)};
  TomlReader views = toml.table("views");
  read_directions(views, plan.views);

  if (toml.contains("lens")) {
    CameraLens lens;
    TomlReader table = toml.table("lens");
    table.require("focal_px", lens.focal_px);
    table.require("principal_point", lens.principal_point);
    table.read("k1", lens.k1);
    table.read("k2", lens.k2);
    plan.lens = lens;
  }
  TomlReader white = toml.table("white");
  white.read("reflectance", plan.white_reflectance);
  if (toml.contains("mirror")) {
    int light = 0;
    TomlReader table = toml.table("mirror");
    table.require("light", light);
    plan.mirror_light = light;
  }
  if (const Status checked = plan.check(); !checked)
    toml.add_error("capture", checked.error().what);
  return plan;
}

Status CapturePlan::check() const {
  VENEER_TRY(check_range("board.columns", board.columns, 3, 200));
  VENEER_TRY(check_range("board.rows", board.rows, 3, 200));
  VENEER_TRY(check_positive("board.square_mm", board.square_mm));
  if (!(board.marker_mm > 0 && board.marker_mm < board.square_mm))
    return out_of_range("board.marker_mm",
                        fmt::format("{}", board.marker_mm),
                        fmt::format("above 0 and less than the square's {}", board.square_mm));
  if (board.dictionary.empty())
    return out_of_range("board.dictionary", "empty", "OpenCV's name, such as DICT_4X4_100");
  VENEER_TRY(check_finite("sample.left_mm", area.left_mm));
  VENEER_TRY(check_finite("sample.top_mm", area.top_mm));
  VENEER_TRY(check_positive("sample.width_mm", area.width_mm));
  VENEER_TRY(check_positive("sample.height_mm", area.height_mm));
  VENEER_TRY(check_finite("sample.lift_mm", area.lift_mm));
  VENEER_TRY(check_range("sample.columns", area.columns, 1, 16384));
  VENEER_TRY(check_range("sample.rows", area.rows, 1, 16384));
  VENEER_TRY(check_polarisation(polarisation));
  VENEER_TRY(check_range("exposure.step", exposure.step, 1.5, 64));
  VENEER_TRY(check_range("exposure.most", exposure.most, 1, 12));
  VENEER_TRY(check_range("exposure.frames", exposure.frames, 1, 1000));
  VENEER_TRY(check_range("exposure.multiple_of_s", exposure.multiple_of_s, 0, 60));
  VENEER_TRY(check_lights(*this));
  VENEER_TRY(check_directions("views", views));
  if (lens) VENEER_TRY(check_lens(*lens));
  return check_range("white.reflectance", white_reflectance, 0.01, 1.5);
}

}  // namespace veneer::capture
