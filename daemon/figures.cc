// SPDX-License-Identifier: Apache-2.0
#include "daemon/figures.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/statistics.h"

namespace veneer::daemon {

using service::LatencyBudget;

namespace {

constexpr std::array kColumns{&LatencyBudget::tracker,
                              &LatencyBudget::hand_off,
                              &LatencyBudget::wait,
                              &LatencyBudget::draw,
                              &LatencyBudget::gpu_draw,
                              &LatencyBudget::compensate,
                              &LatencyBudget::present,
                              &LatencyBudget::display};
// Bits of one word.
constexpr unsigned kDark = 1;
constexpr unsigned kOut = 2;

}  // namespace

LatencyBudget medians(const std::vector<LatencyBudget>& budgets) {
  LatencyBudget median;
  std::vector<double> values(budgets.size());
  for (double LatencyBudget::*column : kColumns) {
    for (std::size_t i = 0; i < budgets.size(); ++i) values[i] = budgets[i].*column;
    median.*column = quantile(values, 0.5);
  }
  return median;
}

FigureBoard::FigureBoard() : slots_(std::make_unique<std::array<Slot, kSlots>>()) {}

void FigureBoard::post(const FrameFigures& figures) {
  static_assert(kColumns.size() + 6 == kWords);
  const std::uint64_t number = posted_.load(std::memory_order_relaxed);
  Slot& slot = (*slots_)[number % kSlots];
  slot.stamp.store(2 * number + 1, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  std::size_t word = 0;
  const auto put = [&](auto value) {
    slot.words[word++].store(std::bit_cast<std::uint64_t>(value), std::memory_order_relaxed);
  };
  put(static_cast<std::int64_t>(figures.done.time_since_epoch().count()));
  put(figures.frame_ms);
  put(figures.gpu_ms);
  put(static_cast<std::uint64_t>(figures.late ? 1 : 0));
  put(static_cast<std::uint64_t>((figures.dark ? kDark : 0) | (figures.out ? kOut : 0)));
  put(figures.missed);
  for (double LatencyBudget::*column : kColumns) put(figures.latency_ms.*column);
  slot.stamp.store(2 * number + 2, std::memory_order_release);
  dropped_.store(figures.dropped, std::memory_order_relaxed);
  late_.store(figures.late_total, std::memory_order_relaxed);
  if (figures.out) out_.fetch_add(1, std::memory_order_relaxed);
  posted_.store(number + 1, std::memory_order_release);
}

std::vector<FrameFigures> FigureBoard::after(Time since) const {
  std::vector<FrameFigures> found;
  const std::uint64_t posted = posted_.load(std::memory_order_acquire);
  for (std::uint64_t back = 1; back <= std::min<std::uint64_t>(posted, kSlots); ++back) {
    const std::uint64_t number = posted - back;
    const Slot& slot = (*slots_)[number % kSlots];
    if (slot.stamp.load(std::memory_order_acquire) != 2 * number + 2) break;  // gone over
    std::array<std::uint64_t, kWords> words{};
    for (std::size_t i = 0; i < kWords; ++i)
      words[i] = slot.words[i].load(std::memory_order_relaxed);
    std::atomic_thread_fence(std::memory_order_acquire);
    if (slot.stamp.load(std::memory_order_relaxed) != 2 * number + 2) break;
    FrameFigures figures;
    figures.done = Time{Duration{std::bit_cast<std::int64_t>(words[0])}};
    if (figures.done <= since) break;
    figures.frame_ms = std::bit_cast<double>(words[1]);
    figures.gpu_ms = std::bit_cast<double>(words[2]);
    figures.late = words[3] != 0;
    figures.dark = (words[4] & kDark) != 0;
    figures.out = (words[4] & kOut) != 0;
    figures.missed = words[5];
    for (std::size_t i = 0; i < kColumns.size(); ++i)
      figures.latency_ms.*kColumns[i] = std::bit_cast<double>(words[6 + i]);
    found.push_back(figures);
  }
  return found;
}

FigureBoard::Figures FigureBoard::last_second(Time now) const {
  constexpr Duration kSecond = std::chrono::seconds(1);
  Figures figures;
  figures.frames = frames();
  figures.dropped = dropped_;
  figures.late = late_;
  const std::vector<FrameFigures> frames = after(now - kSecond);
  if (frames.empty()) return figures;
  figures.frame_rate_hz = static_cast<double>(std::ranges::count(frames, true, &FrameFigures::out));
  std::vector<double> frame_ms;
  std::vector<double> gpu_ms;
  std::vector<LatencyBudget> budgets;
  for (const FrameFigures& frame : frames) {
    if (frame.dark) continue;
    frame_ms.push_back(frame.frame_ms);
    if (!std::isnan(frame.gpu_ms)) gpu_ms.push_back(frame.gpu_ms);
    budgets.push_back(frame.latency_ms);
  }
  figures.frame_ms_median = quantile(frame_ms, 0.5);
  figures.frame_ms_p95 = quantile(frame_ms, 0.95);
  figures.gpu_ms_median = quantile(gpu_ms, 0.5);
  figures.latency_ms = medians(budgets);
  return figures;
}

std::optional<double> FigureBoard::late_part(Time now, Duration span) const {
  const std::vector<FrameFigures> frames = after(now - span);
  if (frames.empty() || frames.size() == turns()) return std::nullopt;
  std::uint64_t late = 0;
  std::uint64_t missed = 0;
  for (const FrameFigures& frame : frames) {
    if (frame.dark) continue;
    late += frame.late ? 1 : 0;
    missed += frame.missed;
  }
  return static_cast<double>(late + missed) / static_cast<double>(frames.size() + missed);
}

}  // namespace veneer::daemon
