// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "capture/internal_plan_json.h"

namespace veneer::capture {
namespace {

using nlohmann::json;

template <class Vector>
json list_of(const Vector& vector) {
  return json(std::vector<double>(vector.data(), vector.data() + vector.size()));
}

json list_of(const btf::DirectionSet& directions) {
  json list = json::array();
  for (const btf::Direction& each : directions) list.push_back(list_of<btf::Direction>(each));
  return list;
}

/// Reads fields and remembers whether one was not what it should be.
class Fields {
 public:
  explicit Fields(const json& object) : object_(object) {}

  [[nodiscard]] const json& at(const char* key) const {
    static const json nothing;
    const auto found = object_.find(key);
    return found == object_.end() ? nothing : *found;
  }
  void read(const char* key, double& value) {
    if (take(key, at(key).is_number())) value = at(key).get<double>();
  }
  void read(const char* key, int& value) {
    // Beyond int, a cast would say something else.
    const json& there = at(key);
    if (take(
            key,
            there.is_number_integer() && there.get<double>() >= -1e9 && there.get<double>() <= 1e9))
      value = there.get<int>();
  }
  void read(const char* key, std::string& value) {
    if (take(key, at(key).is_string())) value = at(key).get<std::string>();
  }
  void read(const char* key, std::vector<double>& value) {
    if (take(key, numbers(at(key)))) value = at(key).get<std::vector<double>>();
  }
  template <int kSize>
  void read(const char* key, Eigen::Matrix<double, kSize, 1>& value) {
    if (take(key, numbers(at(key)) && at(key).size() == kSize))
      value = Eigen::Map<const Eigen::Matrix<double, kSize, 1>>(
          at(key).get<std::vector<double>>().data());
  }
  void read(const char* key, btf::DirectionSet& value) {
    const json& list = at(key);
    const auto three = [](const json& each) { return numbers(each) && each.size() == 3; };
    if (!take(key, list.is_array() && std::all_of(list.begin(), list.end(), three))) return;
    for (const json& each : list)
      value.push_back(Eigen::Map<const Eigen::Vector3d>(each.get<std::vector<double>>().data()));
  }
  [[nodiscard]] Status status() const {
    if (bad_.empty()) return {};
    return fail(Errc::kBadFormat, "its \"{}\" is missing or no such thing", bad_);
  }

 private:
  static bool numbers(const json& list) {
    return list.is_array() &&
           std::all_of(list.begin(), list.end(), [](const json& each) { return each.is_number(); });
  }
  bool take(const char* key, bool good) {
    if (!good && bad_.empty()) bad_ = key;
    return good;
  }
  const json& object_;
  std::string bad_;
};

}  // namespace

json json_of(const CapturePlan& plan) {
  const Eigen::Quaterniond& turn = plan.world_from_sample.rotation;
  json result{{"name", plan.name},
              {"board",
               {{"columns", plan.board.columns},
                {"rows", plan.board.rows},
                {"square_mm", plan.board.square_mm},
                {"marker_mm", plan.board.marker_mm},
                {"dictionary", plan.board.dictionary}}},
              {"area",
               {{"left_mm", plan.area.left_mm},
                {"top_mm", plan.area.top_mm},
                {"width_mm", plan.area.width_mm},
                {"height_mm", plan.area.height_mm},
                {"lift_mm", plan.area.lift_mm},
                {"columns", plan.area.columns},
                {"rows", plan.area.rows}}},
              {"polarisation",
               {{"axis", list_of(plan.polarisation.axis)},
                {"analyser_rad", plan.polarisation.analyser_rad}}},
              {"exposure",
               {{"step", plan.exposure.step},
                {"most", plan.exposure.most},
                {"frames", plan.exposure.frames},
                {"multiple_of_s", plan.exposure.multiple_of_s}}},
              {"light_source", static_cast<int>(plan.light_source)},
              {"lights", list_of(plan.lights)},
              {"ball_radius_mm", plan.ball_radius_mm},
              {"profile", plan.profile},
              {"sample_position", list_of(plan.world_from_sample.translation)},
              {"sample_quaternion_xyzw", list_of(turn.coeffs())},
              {"views", list_of(plan.views)},
              {"white_reflectance", plan.white_reflectance}};
  if (plan.lens)
    result["lens"] = {{"focal_px", list_of(plan.lens->focal_px)},
                      {"principal_point", list_of(plan.lens->principal_point)},
                      {"k1", plan.lens->k1},
                      {"k2", plan.lens->k2}};
  if (plan.mirror_light) result["mirror_light"] = *plan.mirror_light;
  return result;
}

Result<CapturePlan> plan_from(const json& object) {
  CapturePlan plan;
  plan.polarisation.analyser_rad.clear();
  Fields all(object);
  all.read("name", plan.name);
  Fields board(all.at("board"));
  board.read("columns", plan.board.columns);
  board.read("rows", plan.board.rows);
  board.read("square_mm", plan.board.square_mm);
  board.read("marker_mm", plan.board.marker_mm);
  board.read("dictionary", plan.board.dictionary);
  Fields area(all.at("area"));
  area.read("left_mm", plan.area.left_mm);
  area.read("top_mm", plan.area.top_mm);
  area.read("width_mm", plan.area.width_mm);
  area.read("height_mm", plan.area.height_mm);
  area.read("lift_mm", plan.area.lift_mm);
  area.read("columns", plan.area.columns);
  area.read("rows", plan.area.rows);
  Fields polarisation(all.at("polarisation"));
  polarisation.read("axis", plan.polarisation.axis);
  polarisation.read("analyser_rad", plan.polarisation.analyser_rad);
  Fields exposure(all.at("exposure"));
  exposure.read("step", plan.exposure.step);
  exposure.read("most", plan.exposure.most);
  exposure.read("frames", plan.exposure.frames);
  exposure.read("multiple_of_s", plan.exposure.multiple_of_s);
  int source = 0;
  all.read("light_source", source);
  if (source < 0 || source > static_cast<int>(LightSource::kProjector))
    return fail(Errc::kBadFormat, "its \"light_source\" is {}, which is none", source);
  plan.light_source = static_cast<LightSource>(source);
  all.read("lights", plan.lights);
  all.read("ball_radius_mm", plan.ball_radius_mm);
  all.read("profile", plan.profile);
  all.read("sample_position", plan.world_from_sample.translation);
  Eigen::Vector4d quaternion{0, 0, 0, 1};
  all.read("sample_quaternion_xyzw", quaternion);
  if (!(std::abs(quaternion.norm() - 1) < 1e-6))
    return fail(Errc::kBadFormat, "its \"sample_quaternion_xyzw\" is no rotation");
  plan.world_from_sample.rotation.coeffs() = quaternion;
  all.read("views", plan.views);
  all.read("white_reflectance", plan.white_reflectance);
  if (all.at("lens").is_object()) {
    Fields fields(all.at("lens"));
    CameraLens& lens = plan.lens.emplace();
    fields.read("focal_px", lens.focal_px);
    fields.read("principal_point", lens.principal_point);
    fields.read("k1", lens.k1);
    fields.read("k2", lens.k2);
    VENEER_TRY(fields.status());
  }
  if (!all.at("mirror_light").is_null()) all.read("mirror_light", plan.mirror_light.emplace());
  for (const Fields* fields : {&board, &area, &polarisation, &exposure, &all})
    VENEER_TRY(fields->status());
  VENEER_TRY(plan.check());
  return plan;
}

std::string difference(const json& there, const json& here) {
  const json old = there.flatten();
  const json now = here.flatten();
  const auto dotted = [](std::string key) {
    if (key.starts_with('/')) key.erase(0, 1);
    std::ranges::replace(key, '/', '.');
    return key;
  };
  for (const auto& [key, value] : now.items()) {
    if (!old.contains(key)) return fmt::format("it has no {}", dotted(key));
    if (old[key] != value)
      return fmt::format("its {} is {}, not {}", dotted(key), old[key].dump(), value.dump());
  }
  for (const auto& [key, value] : old.items()) {
    if (!now.contains(key))
      return fmt::format("its {} is {}, not absent", dotted(key), value.dump());
  }
  return "nothing";
}

}  // namespace veneer::capture
