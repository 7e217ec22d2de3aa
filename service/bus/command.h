// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <variant>

#include "base/result.h"
#include "service/control.h"

namespace veneer::service {

/// What somebody on the bus wants done, as it came: nothing of it is checked yet.
struct LoadMaterial {
  std::string path;
};
struct SetScene {
  std::string path;
};
struct SetLight {
  int index = 0;
  LightSetting light;
};
struct Blank {
  bool on = true;
};
struct Reload {};
struct Snapshot {};
using Command = std::variant<LoadMaterial, SetScene, SetLight, Blank, Reload, Snapshot>;

/// For texts: "loading the material /a/b.safetensors". Readable whatever the command holds.
[[nodiscard]] std::string text_of(const Command& command);

/// The name of its method on the bus.
[[nodiscard]] std::string_view method_name_of(const Command& command);

/// Whether the daemon is to be troubled with it. Errors: kInvalidOption (a path that is not
/// absolute, too long or holds control characters; a light that is none; an index below 0).
[[nodiscard]] Status check(const Command& command);

/// Checks it and has it done. Returns the path of the picture for Snapshot, else nothing.
/// Errors: those of check() and of ServiceControl.
[[nodiscard]] Result<std::string> carry_out(const Command& command, ServiceControl& control);

/// `text` with what is no UTF-8, or a control character, replaced by '?': a bus carries nothing
/// else, and a terminal should not.
[[nodiscard]] std::string readable(std::string_view text);

/// The name of an error on the bus, and the way back (kUnavailable for a name that is not ours).
[[nodiscard]] std::string error_name_of(Errc code);
[[nodiscard]] Errc errc_of(std::string_view error_name);

}  // namespace veneer::service
