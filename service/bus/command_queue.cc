// SPDX-License-Identifier: Apache-2.0
#include "service/bus/command_queue.h"

#include <sys/eventfd.h>

#include <utility>

namespace veneer::service {
namespace {

/// More than a few people with a few keys each cannot be waiting for.
constexpr std::size_t kMostWaiting = 16;

}  // namespace

CommandQueue::CommandQueue(ServiceControl& control)
    : control_(control), done_fd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  // Without one (no descriptors left) results are found when the bus thread next looks.
  thread_ = std::thread([this] { run(); });
  blanking_thread_ = std::thread([this] { run_blanks(); });
}

CommandQueue::~CommandQueue() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  submitted_.notify_all();
  blank_submitted_.notify_all();
  thread_.join();
  blanking_thread_.join();
}

Status CommandQueue::submit(std::uint64_t id, Command command) {
  VENEER_TRY(check(command));
  {
    const std::scoped_lock lock(mutex_);
    if (const auto* blank = std::get_if<Blank>(&command)) {
      blanks_.push_back({id, *blank});
      blank_submitted_.notify_one();
      return {};
    }
    if (jobs_.size() >= kMostWaiting)
      return fail(Errc::kTimeout,
                  "{}: {} others wait already; try again when they are done",
                  text_of(command),
                  jobs_.size());
    jobs_.push_back({id, std::move(command)});
  }
  submitted_.notify_one();
  return {};
}

std::vector<CommandQueue::Done> CommandQueue::take_done() {
  eventfd_t count = 0;
  ::eventfd_read(done_fd_.value(), &count);
  const std::scoped_lock lock(mutex_);
  return std::exchange(done_, {});
}

void CommandQueue::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    submitted_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (stop_) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    Result<std::string> result = carry_out(job.command, control_);
    lock.lock();
    tell(job.id, std::move(result));
  }
}

// As long as it takes until it is dark, so that several may gather meanwhile.
void CommandQueue::run_blanks() {
  std::unique_lock lock(mutex_);
  while (true) {
    blank_submitted_.wait(lock, [this] { return stop_ || !blanks_.empty(); });
    if (stop_) return;
    const std::vector<WaitingBlank> waiting = std::exchange(blanks_, {});
    lock.unlock();
    const Result<std::string> result = carry_out(waiting.back().command, control_);
    lock.lock();
    for (const WaitingBlank& each : waiting) tell(each.id, result);
  }
}

void CommandQueue::tell(std::uint64_t id, Result<std::string> result) {
  done_.push_back({id, std::move(result)});
  ::eventfd_write(done_fd_.value(), 1);
}

}  // namespace veneer::service
