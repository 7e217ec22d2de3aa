// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace veneer::daemon {

/// veneerd.8, with the options that `app` takes.
[[nodiscard]] std::string manual_page(const CLI::App& app);

}  // namespace veneer::daemon
