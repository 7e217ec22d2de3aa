// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/display_settings.h"

#include "projector/outputs/kms/colour_state.h"

namespace veneer::projector {

Result<DisplaySettings> settings_of(
    KmsDevice& device, const DisplayChoice& display, KmsId mode_blob, KmsId framebuffer, int bits) {
  DisplaySettings result;
  std::vector<KmsSetting>& settings = result.all;
  std::vector<KmsProperty> known;
  const auto set = [&settings, &known](KmsId object, std::string_view name, std::uint64_t value) {
    const KmsProperty* property = find_property(known, name);
    if (property != nullptr) settings.push_back({object, property->id, value});
    return property != nullptr;
  };
  const auto add_neutral = [&settings, &known, bits](KmsId object) {
    const std::vector<KmsSetting> neutral = neutral_settings(object, known, bits);
    settings.insert(settings.end(), neutral.begin(), neutral.end());
  };
  VENEER_ASSIGN(const KmsResources resources, device.resources());
  const KmsId crtc = display.crtc;
  const auto uses_crtc = [&known, crtc] {
    const KmsProperty* user = find_property(known, "CRTC_ID");
    return user != nullptr && user->value == crtc;
  };

  const KmsId connector = display.connector.id;
  for (const KmsId other : resources.connectors) {
    VENEER_ASSIGN(known, device.properties(other, KmsKind::kConnector));
    if (other != connector) {
      if (uses_crtc()) set(other, "CRTC_ID", 0);
      continue;
    }
    if (!set(connector, "CRTC_ID", crtc))
      return fail(Errc::kUnavailable, "the connector cannot be given a picture");
    // Where a cable was pulled, the driver may want to be told to start the link anew.
    if (const KmsProperty* link = find_property(known, "link-status")) {
      if (const auto good = find_choice(*link, "Good"))
        settings.push_back({connector, link->id, *good});
    }
    add_neutral(connector);
  }
  VENEER_ASSIGN(known, device.properties(crtc, KmsKind::kCrtc));
  set(crtc, "MODE_ID", mode_blob);
  set(crtc, "ACTIVE", 1);
  set(crtc, "VRR_ENABLED", 0);
  add_neutral(crtc);
  for (const KmsPlane& plane : resources.planes) {
    VENEER_ASSIGN(known, device.properties(plane.id, KmsKind::kPlane));
    if (plane.id != display.plane.id) {
      // Another program's cursor or overlay would cover the picture.
      if (uses_crtc()) {
        set(plane.id, "CRTC_ID", 0);
        set(plane.id, "FB_ID", 0);
      }
      continue;
    }
    const auto width = static_cast<std::uint64_t>(display.mode.width);
    const auto height = static_cast<std::uint64_t>(display.mode.height);
    const KmsProperty* shows = find_property(known, "FB_ID");
    if (shows == nullptr) return fail(Errc::kUnavailable, "the plane cannot be given a picture");
    result.framebuffer_property = shows->id;
    set(plane.id, "FB_ID", framebuffer);
    set(plane.id, "CRTC_ID", crtc);
    set(plane.id, "SRC_X", 0);
    set(plane.id, "SRC_Y", 0);
    set(plane.id, "SRC_W", width << 16U);  // in 65536ths of a pixel
    set(plane.id, "SRC_H", height << 16U);
    set(plane.id, "CRTC_X", 0);
    set(plane.id, "CRTC_Y", 0);
    set(plane.id, "CRTC_W", width);
    set(plane.id, "CRTC_H", height);
    if (const KmsProperty* rotation = find_property(known, "rotation")) {
      // A bit mask, whose choices are bits' numbers.
      if (const auto upright = find_choice(*rotation, "rotate-0"))
        settings.push_back({plane.id, rotation->id, std::uint64_t{1} << *upright});
    }
    if (const KmsProperty* alpha = find_property(known, "alpha"); alpha != nullptr && alpha->range)
      settings.push_back({plane.id, alpha->id, alpha->range->second});
  }
  return result;
}

}  // namespace veneer::projector
