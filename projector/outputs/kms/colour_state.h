// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

/// One property that changes colours, by what it means rather than by the kernel's numbers, which
/// end with the program.
struct ColourProperty {
  KmsKind kind = KmsKind::kCrtc;
  std::string name;
  std::string bytes;        ///< of a blob: a table or matrix; empty where there is none
  std::string choice;       ///< of an enumeration
  std::uint64_t value = 0;  ///< of any other
};

/// What a card does to colours on their way to one display.
struct ColourState {
  std::string boot;  ///< the kernel's name of this run of the machine: no table outlives it
  std::string driver;
  std::string connector;
  KmsId connector_id = 0;
  KmsId crtc_id = 0;
  std::vector<ColourProperty> properties;
  std::vector<std::uint16_t> ramp;  ///< KmsDevice::gamma_ramp() where there is no GAMMA_LUT
};

[[nodiscard]] Result<ColourState> read_colour_state(KmsDevice& device,
                                                    const KmsConnector& connector,
                                                    KmsId crtc);

/// As text with a checksum, and back. Errors: kBadFormat (damaged, of a later version).
[[nodiscard]] std::string text_of(const ColourState& state);
[[nodiscard]] Result<ColourState> parse_colour_state(std::string_view text);

/// All of it or nothing, but for a ramp, which goes after the properties.
/// @param also  settings of other objects, in the same commit.
/// Errors: kUnavailable (the card refuses, or lacks what was saved).
[[nodiscard]] Status restore_colour_state(KmsDevice& device,
                                          const ColourState& state,
                                          std::vector<KmsSetting> also = {});

/// The settings of a connector and a CRTC with which codes leave as they are: no tables, no matrix,
/// the full range, no dithering, and `bits` bits a channel. Only of properties that there are.
[[nodiscard]] std::vector<KmsSetting> neutral_settings(KmsId object,
                                                       const std::vector<KmsProperty>& properties,
                                                       int bits);
/// The ramp that changes nothing, of as many entries.
[[nodiscard]] std::vector<std::uint16_t> neutral_ramp(std::size_t values);

/// What was found before the first change of colours, kept in a file until it is back, so that it
/// comes back even after a power cut to the program alone (SIGKILL).
class ColourKeeper {
 public:
  /// @param folder  of the state; empty: kept in memory alone.
  ColourKeeper(KmsDevice& device, std::filesystem::path folder);

  /// Brings back what earlier runs left of this card. What cannot be brought back is reported and
  /// left alone; a damaged file is reported, applied in no part and moved aside.
  void restore_leftovers();
  /// Saves what there is; when it returns, it is on the disk. A file that is still there for this
  /// display holds the older truth and stays. Errors: kIo.
  [[nodiscard]] Status keep(const KmsConnector& connector, KmsId crtc);
  /// Brings it back and removes the file. Errors: kUnavailable; the file stays then.
  [[nodiscard]] Status restore(std::vector<KmsSetting> also);

 private:
  [[nodiscard]] std::filesystem::path file_of(std::string_view connector) const;
  [[nodiscard]] Status restore_file(const std::filesystem::path& path);
  KmsDevice& device_;
  std::filesystem::path folder_;
  std::optional<ColourState> kept_;
};

}  // namespace veneer::projector
