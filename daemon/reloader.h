// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "daemon/faults.h"
#include "daemon/file_identity.h"
#include "daemon/show_loader.h"

namespace veneer::daemon {

/// Where the configuration comes from, now and when it is read again.
struct ConfigFile {
  std::filesystem::path path;
  std::vector<std::string> settings;  ///< "key = value" lines that replace what the file says

  /// Reads and checks it. Errors: kNotFound, kIo, kInvalidOption.
  [[nodiscard]] Result<Config> read(std::optional<TomlReader>* reader = nullptr) const;
};

/// Which keys of `now` a reload leaves to the next start, of those that are not as the daemon
/// `started` with them: "[tracker] driver", "frame_rate_hz".
[[nodiscard]] std::vector<std::string> keys_left_to_a_start(const TomlReader& started,
                                                            const TomlReader& now);

/// Reads the files again that a show was made of. What is bad is refused, is a fault from then on,
/// and is tried again whenever one of the files changes, until it is good. Where the files are good
/// and no renderer can be made of them just now, the same is a kConfiguration (the picture of
/// before stays, so it is no kGpu), and is tried again every few seconds. All of it runs on the
/// loader's thread.
///
/// The scene, the material, the profile and the tables [render], [quality] and [presence] are taken
/// from the new files, and display_latency_ms is; all else says how the daemon starts, and where it
/// differs that is a warning. What a call had set (a material, a scene, a light) gives way to what
/// the files say.
class Reloader {
 public:
  /// @param started  the configuration that the daemon started with.
  /// Borrows all but the first two.
  Reloader(ConfigFile file, TomlReader started, ShowLoader& loader, Faults& faults, Clock& clock);

  /// The files of a show that was just made.
  void made_of(const Script& script);
  /// Something else than the files say is shown now.
  void overridden() { overridden_ = true; }
  /// Errors: why it was refused; what is shown stays.
  [[nodiscard]] Status reload();
  /// Tries again what was refused, where a file has changed since or what failed was not a file's
  /// fault; for every now and then.
  void look();

 private:
  using Stamps = std::map<std::filesystem::path, std::optional<FileIdentity>>;
  [[nodiscard]] static Stamps stamps_of(const std::filesystem::path& config, const Script& script);
  [[nodiscard]] Status read_again();
  [[nodiscard]] Status read_all();
  void warn_of_the_rest(const TomlReader& now);
  [[nodiscard]] Status refuse(service::FaultKind kind, const Error& error);

  const ConfigFile file_;
  const TomlReader started_;
  ShowLoader& loader_;
  Faults& faults_;
  Clock& clock_;
  Stamps shown_;                   // of what is shown
  std::optional<Stamps> refused_;  // of what was refused last
  bool overridden_ = false;
  std::vector<std::string> warned_of_;  // since a reload was asked for
  std::optional<Time> again_;           // when good files are tried again
  Time due_;
};

}  // namespace veneer::daemon
