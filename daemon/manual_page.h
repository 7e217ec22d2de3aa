// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace CLI {  // NOLINT(readability-identifier-naming): its own name
class App;
}

namespace veneer::daemon {

/// veneerd.8, with the options that `app` takes.
[[nodiscard]] std::string manual_page(const CLI::App& app);

}  // namespace veneer::daemon
