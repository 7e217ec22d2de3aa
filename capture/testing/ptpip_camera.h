// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/unique_handle.h"

namespace veneer::capture::testing {

/// A file on the camera's card.
struct PtpObject {
  std::string name;
  std::string bytes;
};

/// How a camera misbehaves.
enum class PtpFault : std::uint8_t {
  kBusy,         ///< a capture is answered with Device_Busy
  kRefused,      ///< a capture is answered with General_Error, as out of focus
  kCloseInData,  ///< both connections end in the middle of a file
  kHang,         ///< a capture is never answered
  kNoPicture,    ///< a capture is accepted, and nothing comes of it
};

/// A camera on the loopback that the real libgphoto2 talks to over PTP/IP (CIPA DC-005-2005): a
/// session, one storage, captures with their events, exposure time and sensitivity. One connection
/// at a time, for as long as the object lives.
class PtpipCamera {
 public:
  /// The files that a capture leaves.
  /// @param exposure  as the camera counts it, in units of 0.1 ms.   @param iso  of the property.
  using Shoot = std::function<std::vector<PtpObject>(std::uint32_t exposure, std::uint16_t iso)>;

  explicit PtpipCamera(Shoot shoot);
  ~PtpipCamera();
  PtpipCamera(const PtpipCamera&) = delete;
  PtpipCamera& operator=(const PtpipCamera&) = delete;

  /// As libgphoto2 writes it: "ptpip:127.0.0.1:PORT".
  [[nodiscard]] std::string port() const;
  /// Each of the next captures misbehaves like that, one after the other.
  void misbehave(PtpFault fault, int captures = 1);
  /// The camera has only these shutter speeds, in units of 0.1 ms.
  void offer_exposures(std::vector<std::uint32_t> exposures);
  /// Captures that were asked for, refused ones counted.
  [[nodiscard]] int captures() const { return captures_; }
  [[nodiscard]] std::uint16_t iso() const;
  /// Files that are still on the card.
  [[nodiscard]] int files() const;

 private:
  struct Request;
  struct Answer;
  void serve();
  void serve_connection(int command, int event);
  [[nodiscard]] Answer answer(const Request& request);
  [[nodiscard]] Answer capture();
  void send_events(int event);

  Shoot shoot_;
  UniqueFd listener_;
  UniqueFd stop_;  // an eventfd, readable once the camera is to end
  int port_ = 0;
  std::atomic<int> captures_{0};

  mutable std::mutex mutex_;
  std::deque<PtpFault> faults_;
  std::vector<std::uint32_t> exposures_{1, 10, 80, 1250, 5000, 10000};
  std::uint32_t exposure_ = 80;
  std::uint16_t iso_ = 100;
  std::map<std::uint32_t, PtpObject> objects_;
  std::uint32_t last_handle_ = 0;
  std::vector<std::pair<std::uint16_t, std::uint32_t>> events_;  // code, parameter
  bool close_in_data_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace veneer::capture::testing
