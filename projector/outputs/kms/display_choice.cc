// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/display_choice.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

namespace veneer::projector {
namespace {

/// 59.94 and 60 are both offered by many displays; further apart is another rate.
constexpr double kRateTolerance_hz = 0.5;

std::string modes_of(const KmsConnector& connector) {
  std::string text;
  for (const KmsMode& mode : connector.modes) {
    if (!mode.interlaced) text += " " + name_of(mode);
  }
  return text;
}

struct WantedMode {
  int width = 0;
  int height = 0;
  double refresh_hz = 0;  // 0: any
};

std::optional<WantedMode> parse_mode(std::string_view text) {
  WantedMode wanted;
  const char* at = text.data();
  const char* end = at + text.size();
  const auto number = [&at, end](auto& value) {
    const auto parsed = std::from_chars(at, end, value);
    at = parsed.ptr;
    return parsed.ec == std::errc{} && value > 0;
  };
  if (!number(wanted.width) || at == end || *at++ != 'x' || !number(wanted.height))
    return std::nullopt;
  if (at == end) return wanted;
  if (*at++ != '@' || !number(wanted.refresh_hz) || at != end || !std::isfinite(wanted.refresh_hz))
    return std::nullopt;
  return wanted;
}

std::uint64_t value_of(const std::vector<KmsProperty>& properties, std::string_view name) {
  const KmsProperty* property = find_property(properties, name);
  return property == nullptr ? 0 : property->value;
}

bool has(const std::vector<KmsId>& ids, KmsId id) { return std::ranges::count(ids, id) > 0; }

/// The CRTC that the connector has already, or else a free one: another display is not to go dark.
Result<KmsId> choose_crtc(KmsDevice& device,
                          const KmsResources& resources,
                          const KmsConnector& connector) {
  std::set<KmsId> taken;
  KmsId own = 0;
  for (const KmsId id : resources.connectors) {
    VENEER_ASSIGN(const std::vector<KmsProperty> properties,
                  device.properties(id, KmsKind::kConnector));
    const auto crtc = static_cast<KmsId>(value_of(properties, "CRTC_ID"));
    if (id == connector.id) {
      own = crtc;
    } else {
      taken.insert(crtc);
    }
  }
  if (own != 0 && !taken.contains(own) && has(connector.possible_crtcs, own)) return own;
  for (const KmsId crtc : connector.possible_crtcs) {
    if (!taken.contains(crtc)) return crtc;
  }
  return fail(Errc::kUnavailable,
              "{} has no scan-out engine left: other displays of the card use all {}; unplug one",
              connector.name,
              connector.possible_crtcs.size());
}

Result<KmsPlane> choose_plane(KmsDevice& device, const KmsResources& resources, KmsId crtc) {
  const KmsPlane* chosen = nullptr;
  for (const KmsPlane& plane : resources.planes) {
    if (!has(plane.possible_crtcs, crtc)) continue;
    VENEER_ASSIGN(const std::vector<KmsProperty> properties,
                  device.properties(plane.id, KmsKind::kPlane));
    const KmsProperty* type = find_property(properties, "type");
    if (type == nullptr || find_choice(*type, "Primary") != type->value) continue;
    const std::uint64_t user = value_of(properties, "CRTC_ID");
    if (user == crtc) return plane;
    if (user == 0 && chosen == nullptr) chosen = &plane;
  }
  if (chosen != nullptr) return *chosen;
  return fail(Errc::kUnavailable, "no primary plane of the card is free");
}

}  // namespace

Result<std::vector<KmsConnector>> sockets_of(KmsDevice& device) {
  VENEER_ASSIGN(const KmsResources resources, device.resources());
  std::vector<KmsConnector> all;
  for (const KmsId id : resources.connectors) {
    VENEER_ASSIGN(KmsConnector each, device.connector(id, true));
    all.push_back(std::move(each));
  }
  return all;
}

bool fits(const KmsConnector& socket, std::string_view connector) {
  if (connector.empty()) return socket.connected;
  if (socket.name == connector) return true;
  const EdidIdentity identity = read_edid(socket.edid);
  return socket.connected && (identity.name == connector || identity.serial == connector);
}

bool is_silent(const KmsConnector& socket) { return !socket.connected || socket.edid.empty(); }

std::string list_of(std::string_view path, const std::vector<KmsConnector>& sockets) {
  if (sockets.empty()) return fmt::format("\n  {}: the card has no connector", path);
  std::string text;
  for (const KmsConnector& each : sockets)
    text += fmt::format("\n  {} {}{}",
                        path,
                        name_of(each),
                        each.connected ? "; modes:" + modes_of(each) : " (nothing connected)");
  return text;
}

Error no_such_display(std::string_view connector,
                      std::string_view where,
                      bool may_come,
                      std::string_view list) {
  if (connector.empty())
    return {Errc::kUnavailable,
            fmt::format("no display is connected to {}; switch the projector on and check the "
                        "cable; there are:{}",
                        where,
                        list)};
  if (may_come)
    return {Errc::kUnavailable,
            fmt::format("no display on {} says that it is \"{}\". Either the projector is off or "
                        "its cable is out: switch it on and check the cable. Or the name is wrong: "
                        "set connector to a name or a serial of these:{}",
                        where,
                        connector,
                        list)};
  return {Errc::kInvalidOption,
          fmt::format("there is no display \"{}\" on {}; set connector to a name or a serial of "
                      "these:{}",
                      connector,
                      where,
                      list)};
}

std::string name_of(const KmsMode& mode) {
  return fmt::format("{}x{}@{:.2f}", mode.width, mode.height, mode.refresh_hz);
}

std::string name_of(const KmsConnector& connector) {
  const EdidIdentity identity = read_edid(connector.edid);
  std::string text = connector.name;
  if (!identity.name.empty()) text += ": " + identity.name;
  if (!identity.serial.empty()) text += ", serial " + identity.serial;
  return text;
}

Result<KmsMode> choose_mode(const KmsConnector& connector, std::string_view mode) {
  WantedMode wanted;
  if (!mode.empty()) {
    const std::optional<WantedMode> parsed = parse_mode(mode);
    if (!parsed)
      return fail(Errc::kInvalidOption,
                  "mode \"{}\" is not understood; write it as \"1920x1080\" or \"1920x1080@60\"",
                  mode);
    wanted = *parsed;
  }
  const KmsMode* best = nullptr;
  const auto worth = [&wanted](const KmsMode& m) {  // the less, the better
    return wanted.refresh_hz > 0 ? std::abs(m.refresh_hz - wanted.refresh_hz)
                                 : (m.preferred ? 0.0 : 1.0);
  };
  for (const KmsMode& each : connector.modes) {
    if (each.interlaced || !(each.refresh_hz > 0)) continue;
    if (!mode.empty() && (each.width != wanted.width || each.height != wanted.height)) continue;
    if (wanted.refresh_hz > 0 && worth(each) > kRateTolerance_hz) continue;
    if (best == nullptr || worth(each) < worth(*best)) best = &each;
  }
  if (best != nullptr) return *best;
  if (mode.empty() || connector.modes.empty())
    return fail(Errc::kUnavailable,
                "{} offers no mode; switch the projector on and check the cable",
                name_of(connector));
  if (is_silent(connector))
    return fail(
        Errc::kUnavailable,
        "no mode \"{}\" at {}, whose display says nothing of itself. Either it is not awake "
        "yet: switch the projector on and check the cable. Or it has no such mode; there "
        "are:{}",
        mode,
        connector.name,
        modes_of(connector));
  return fail(Errc::kInvalidOption,
              "no mode \"{}\" at {}; there are:{}",
              mode,
              name_of(connector),
              modes_of(connector));
}

Result<DisplayChoice> choose_display(KmsDevice& device,
                                     std::string_view connector,
                                     std::string_view mode) {
  VENEER_ASSIGN(const KmsResources resources, device.resources());
  VENEER_ASSIGN(const std::vector<KmsConnector> all, sockets_of(device));
  std::vector<const KmsConnector*> fitting;
  for (const KmsConnector& each : all) {
    if (fits(each, connector)) fitting.push_back(&each);
  }
  if (fitting.empty())
    return tl::unexpected<Error>(no_such_display(connector,
                                                 device.path(),
                                                 all.empty() || std::ranges::any_of(all, is_silent),
                                                 list_of(device.path(), all)));
  if (fitting.size() > 1)
    return fail(Errc::kInvalidOption,
                "{} displays on {} would do; set connector to a name or a serial of these:{}",
                fitting.size(),
                device.path(),
                list_of(device.path(), all));
  DisplayChoice choice;
  choice.connector = *fitting.front();
  choice.identity = read_edid(choice.connector.edid);
  if (!choice.connector.connected)
    return fail(Errc::kUnavailable,
                "nothing is connected to {} of {}; switch the projector on and check the cable",
                choice.connector.name,
                device.path());
  VENEER_ASSIGN(choice.mode, choose_mode(choice.connector, mode));
  VENEER_ASSIGN(choice.crtc, choose_crtc(device, resources, choice.connector));
  VENEER_ASSIGN(choice.plane, choose_plane(device, resources, choice.crtc));
  return choice;
}

}  // namespace veneer::projector
