// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sdbus-c++/sdbus-c++.h>

#include <memory>

#include "base/clock.h"
#include "service/bus/bus_address.h"

namespace veneer::service {

/// Errors: kUnavailable (no such bus, or it does not answer).
[[nodiscard]] Result<std::unique_ptr<sdbus::IConnection>> connect_to(const BusAddress& address,
                                                                     Duration call_timeout);

}  // namespace veneer::service
