// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/colour_state.h"

#include <nlohmann/json.hpp>
#include <sha2.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "base/files.h"

namespace veneer::projector {
namespace {

using Json = nlohmann::json;

constexpr int kVersion = 1;

/// What is set, and so what is saved. Their names are the kernel's (drm-kms, "KMS Properties", and
/// the drivers' own for dithering).
struct Neutral {
  KmsKind kind;
  std::string_view name;
  std::string_view
      choice;  ///< of an enumeration; a blob becomes none, "max bpc" is a case of its own
};
constexpr std::string_view kMaxBits = "max bpc";
constexpr std::array kNeutral{
    Neutral{KmsKind::kCrtc, "GAMMA_LUT", ""},
    Neutral{KmsKind::kCrtc, "DEGAMMA_LUT", ""},
    Neutral{KmsKind::kCrtc, "CTM", ""},
    Neutral{KmsKind::kConnector, "Broadcast RGB", "Full"},
    Neutral{KmsKind::kConnector, "Colorspace", "Default"},
    Neutral{KmsKind::kConnector, "HDR_OUTPUT_METADATA", ""},
    Neutral{KmsKind::kConnector, "dither", "off"},
    Neutral{KmsKind::kConnector, "dithering mode", "off"},
    Neutral{KmsKind::kConnector, "underscan", "off"},
    Neutral{KmsKind::kConnector, kMaxBits, ""},
};

std::string boot_name() {
  // A file of /proc says that it is empty, and is read nevertheless.
  return read_text("/proc/sys/kernel/random/boot_id").value_or("");
}

std::string hex_of(std::string_view bytes) {
  std::string text;
  text.reserve(2 * bytes.size());
  for (const char c : bytes) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    const auto byte = static_cast<unsigned char>(c);
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

std::optional<std::string> bytes_of(std::string_view hex) {
  const auto digit = [](char c) -> int {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return -1;
  };
  if (hex.size() % 2 != 0) return std::nullopt;
  std::string bytes;
  bytes.reserve(hex.size() / 2);
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    const int high = digit(hex[i]);
    const int low = digit(hex[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    bytes += static_cast<char>(high * 16 + low);
  }
  return bytes;
}

std::string checksum_of(const std::string& text) {
  std::array<char, SHA256_DIGEST_STRING_LENGTH> digest{};
  SHA256Data(reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), digest.data());
  return digest.data();
}

ColourState state_of(const Json& json) {
  ColourState state;
  json.at("boot").get_to(state.boot);
  json.at("driver").get_to(state.driver);
  json.at("connector").get_to(state.connector);
  json.at("connector_id").get_to(state.connector_id);
  json.at("crtc_id").get_to(state.crtc_id);
  json.at("ramp").get_to(state.ramp);
  for (const Json& each : json.at("properties")) {
    ColourProperty property;
    property.kind = each.at("of") == "crtc" ? KmsKind::kCrtc : KmsKind::kConnector;
    each.at("name").get_to(property.name);
    each.at("choice").get_to(property.choice);
    each.at("value").get_to(property.value);
    property.bytes = bytes_of(each.at("bytes").get<std::string>()).value();
    state.properties.push_back(std::move(property));
  }
  return state;
}

/// Blobs that live until a commit has taken them over.
class Blobs {
 public:
  explicit Blobs(KmsDevice& device) : device_(device) {}
  ~Blobs() {
    for (const KmsId id : ids_) device_.destroy_blob(id);
  }
  Blobs(const Blobs&) = delete;
  Blobs& operator=(const Blobs&) = delete;
  [[nodiscard]] Result<KmsId> add(std::string_view bytes) {
    VENEER_ASSIGN(const KmsId id, device_.create_blob(bytes));
    ids_.push_back(id);
    return id;
  }

 private:
  KmsDevice& device_;
  std::vector<KmsId> ids_;
};

}  // namespace

Result<ColourState> read_colour_state(KmsDevice& device,
                                      const KmsConnector& connector,
                                      KmsId crtc) {
  ColourState state;
  state.boot = boot_name();
  state.driver = device.driver();
  state.connector = connector.name;
  state.connector_id = connector.id;
  state.crtc_id = crtc;
  VENEER_ASSIGN(const auto of_crtc, device.properties(crtc, KmsKind::kCrtc));
  VENEER_ASSIGN(const auto of_connector, device.properties(connector.id, KmsKind::kConnector));
  for (const Neutral& each : kNeutral) {
    const KmsProperty* property =
        find_property(each.kind == KmsKind::kCrtc ? of_crtc : of_connector, each.name);
    if (property == nullptr) continue;
    ColourProperty saved{each.kind, property->name, "", "", property->value};
    if (property->is_blob && property->value != 0) {
      VENEER_ASSIGN(saved.bytes, device.blob(static_cast<KmsId>(property->value)));
    }
    for (const auto& [name, value] : property->choices) {
      if (value == property->value) saved.choice = name;
    }
    if (property->is_blob) saved.value = 0;  // the kernel's number for it ends with its owner
    state.properties.push_back(std::move(saved));
  }
  if (find_property(of_crtc, "GAMMA_LUT") == nullptr) state.ramp = device.gamma_ramp(crtc);
  return state;
}

std::string text_of(const ColourState& state) {
  Json properties = Json::array();
  for (const ColourProperty& each : state.properties)
    properties.push_back({{"of", each.kind == KmsKind::kCrtc ? "crtc" : "connector"},
                          {"name", each.name},
                          {"bytes", hex_of(each.bytes)},
                          {"choice", each.choice},
                          {"value", each.value}});
  const Json json{{"version", kVersion},
                  {"boot", state.boot},
                  {"driver", state.driver},
                  {"connector", state.connector},
                  {"connector_id", state.connector_id},
                  {"crtc_id", state.crtc_id},
                  {"properties", properties},
                  {"ramp", state.ramp}};
  const std::string text = json.dump(-1, ' ', true, Json::error_handler_t::replace);
  return Json{{"checksum", checksum_of(text)}, {"state", text}}.dump() + "\n";
}

Result<ColourState> parse_colour_state(std::string_view text) {
  // The JSON library throws; nothing of it leaves this function.
  try {
    const Json whole = Json::parse(text);
    const auto inner = whole.at("state").get<std::string>();
    if (whole.at("checksum") != checksum_of(inner))
      return fail(Errc::kBadFormat, "its checksum is wrong: it was damaged or edited");
    const Json json = Json::parse(inner);
    if (json.at("version") != kVersion)
      return fail(Errc::kBadFormat,
                  "it is of version {}, this program knows version {}",
                  json.at("version").dump(),
                  kVersion);
    return state_of(json);
  } catch (const std::exception& error) {
    return fail(Errc::kBadFormat, "it is damaged: {}", error.what());
  }
}

Status restore_colour_state(KmsDevice& device,
                            const ColourState& state,
                            std::vector<KmsSetting> also) {
  VENEER_ASSIGN(const auto of_crtc, device.properties(state.crtc_id, KmsKind::kCrtc));
  VENEER_ASSIGN(const auto of_connector,
                device.properties(state.connector_id, KmsKind::kConnector));
  Blobs blobs(device);
  std::vector<KmsSetting> settings = std::move(also);
  for (const KmsKind kind : {KmsKind::kCrtc, KmsKind::kConnector}) {
    for (const ColourProperty& saved : state.properties) {
      if (saved.kind != kind) continue;
      const bool crtc = kind == KmsKind::kCrtc;
      const KmsProperty* property = find_property(crtc ? of_crtc : of_connector, saved.name);
      if (property == nullptr)
        return fail(Errc::kUnavailable, "the card has no \"{}\" any more", saved.name);
      std::uint64_t value = saved.value;
      if (!saved.bytes.empty()) {
        VENEER_ASSIGN(value, blobs.add(saved.bytes));
      }
      if (!saved.choice.empty()) value = find_choice(*property, saved.choice).value_or(saved.value);
      settings.push_back({crtc ? state.crtc_id : state.connector_id, property->id, value});
    }
  }
  if (const int refused = device.commit(settings, KmsCommit::kFull); refused != 0)
    return fail(Errc::kUnavailable, "the card refuses it: {}", std::strerror(refused));
  if (!state.ramp.empty()) {
    if (const int refused = device.set_gamma_ramp(state.crtc_id, state.ramp); refused != 0)
      return fail(Errc::kUnavailable, "the card refuses the ramp: {}", std::strerror(refused));
  }
  return {};
}

std::vector<KmsSetting> neutral_settings(KmsId object,
                                         const std::vector<KmsProperty>& properties,
                                         int bits) {
  std::vector<KmsSetting> settings;
  for (const Neutral& each : kNeutral) {
    const KmsProperty* property = find_property(properties, each.name);
    if (property == nullptr) continue;
    if (each.name == kMaxBits) {
      std::uint64_t value = static_cast<std::uint64_t>(bits);
      if (property->range)
        value = std::clamp(value, property->range->first, property->range->second);
      settings.push_back({object, property->id, value});
    } else if (property->is_blob) {
      settings.push_back({object, property->id, 0});
    } else if (const auto value = find_choice(*property, each.choice)) {
      settings.push_back({object, property->id, *value});
    }
  }
  return settings;
}

std::vector<std::uint16_t> neutral_ramp(std::size_t values) {
  const std::size_t size = values / 3;
  std::vector<std::uint16_t> ramp(3 * size);
  for (std::size_t i = 0; i < ramp.size(); ++i)
    ramp[i] = size < 2
                  ? 65535
                  : static_cast<std::uint16_t>((i % size * 65535 + (size - 1) / 2) / (size - 1));
  return ramp;
}

ColourKeeper::ColourKeeper(KmsDevice& device, std::filesystem::path folder)
    : device_(device), folder_(std::move(folder)) {}

std::filesystem::path ColourKeeper::file_of(std::string_view connector) const {
  const std::string card = std::filesystem::path(device_.path()).filename().string();
  return folder_ / fmt::format("kms-{}-{}.json", card, connector);
}

void ColourKeeper::restore_leftovers() {
  if (folder_.empty()) return;
  const std::string prefix = file_of("").filename().string();  // ends in "-.json"
  std::vector<std::filesystem::path> left;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, absent)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(prefix.substr(0, prefix.size() - 5)) && name.ends_with(".json"))
      left.push_back(entry.path());
  }
  std::ranges::sort(left);
  for (const std::filesystem::path& path : left) {
    if (const Status restored = restore_file(path); !restored)
      spdlog::error("bringing back the colour tables of {} that an earlier run saved in {}: {}",
                    device_.path(),
                    path.string(),
                    restored.error().what);
  }
}

Status ColourKeeper::restore_file(const std::filesystem::path& path) {
  VENEER_ASSIGN(const std::string text, read_text(path));
  std::error_code error;
  const Result<ColourState> state = parse_colour_state(text);
  if (!state) {
    std::filesystem::path aside = path;
    aside += ".damaged";
    std::filesystem::rename(path, aside, error);
    return fail(state.error().code,
                "{}; nothing of it is used, and it is now called {}. Colours of other programs on "
                "this display may be off until they set them or the machine starts anew",
                state.error().what,
                aside.filename().string());
  }
  if (state->boot == boot_name() && state->driver == device_.driver()) {
    VENEER_TRY(restore_colour_state(device_, *state));
    spdlog::warn(
        "the last run did not end by itself; the colour tables that it had found on {} "
        "are back",
        state->connector);
  }
  // After a new start of the machine there is nothing to bring back.
  std::filesystem::remove(path, error);
  return {};
}

Status ColourKeeper::keep(const KmsConnector& connector, KmsId crtc) {
  VENEER_ASSIGN(kept_, read_colour_state(device_, connector, crtc));
  if (folder_.empty()) {
    spdlog::warn(
        "no state_directory: the colour tables of {} are kept in memory alone, and are lost if "
        "this program is killed",
        connector.name);
    return {};
  }
  const std::filesystem::path path = file_of(connector.name);
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    VENEER_ASSIGN(const std::string text, read_text(path));
    VENEER_ASSIGN(kept_, parse_colour_state(text));
    return {};
  }
  return write_text(path, text_of(*kept_));
}

Status ColourKeeper::restore(std::vector<KmsSetting> also) {
  if (!kept_) return {};
  if (const Status restored = restore_colour_state(device_, *kept_, std::move(also)); !restored)
    return fail(restored.error().code,
                "bringing back the colour tables of {}: {}{}",
                kept_->connector,
                restored.error().what,
                folder_.empty() ? "" : "; the next start tries again");
  std::error_code error;
  if (!folder_.empty()) std::filesystem::remove(file_of(kept_->connector), error);
  kept_.reset();
  return {};
}

}  // namespace veneer::projector
