// SPDX-License-Identifier: Apache-2.0
#include "service/bus/internal_connection.h"

namespace veneer::service {

Result<std::unique_ptr<sdbus::IConnection>> connect_to(const BusAddress& address,
                                                       Duration call_timeout) {
  try {
    std::unique_ptr<sdbus::IConnection> connection;
    if (address.text() == "system") {
      connection = sdbus::createSystemBusConnection();
    } else if (address.text() == "session") {
      connection = sdbus::createSessionBusConnection();
    } else {
      connection = sdbus::createSessionBusConnectionWithAddress(address.text());
    }
    connection->setMethodCallTimeout(call_timeout);
    return connection;
  } catch (const sdbus::Error& error) {
    return fail(Errc::kUnavailable,
                "connecting to {}: {}; is dbus-daemon running?",
                address.name(),
                error.getMessage());
  }
}

}  // namespace veneer::service
