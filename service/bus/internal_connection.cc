// SPDX-License-Identifier: Apache-2.0
#include "service/bus/internal_connection.h"

namespace veneer::service {
namespace {

std::string_view remedy_for(const BusAddress& address) {
  if (address.text() == "system") return "is dbus-daemon running? systemctl status dbus";
  if (address.text() == "session")
    return "only a desktop's session has one, and tells it by DBUS_SESSION_BUS_ADDRESS";
  return "is it the right address, and does a dbus-daemon listen there?";
}

}  // namespace

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
                "connecting to {}: {}; {}",
                address.name(),
                error.getMessage(),
                remedy_for(address));
  }
}

}  // namespace veneer::service
