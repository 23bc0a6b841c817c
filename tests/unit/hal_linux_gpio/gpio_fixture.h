// A trigger on fake chips, in virtual time.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/linux/gpio/trigger.h"
#include "tests/support/gpio_chips.h"

namespace nodal::hal::gpio {

class GpioTest : public testing::Test {
 protected:
  GpioTest() { chips_.add("gpiochip0", "pinctrl-main", 32); }

  static LineName line(std::uint32_t offset) { return {"gpiochip0", offset}; }
  void add_output(std::uint32_t offset, std::vector<HeadIndex> heads) {
    lines_.outputs.emplace_back().line = line(offset);
    lines_.outputs.back().heads = std::move(heads);
  }
  void open() {
    auto opened = GpioTrigger::open(chips_, lines_);
    if (!opened) throw std::runtime_error(opened.error().text());
    trigger_ = std::move(*opened);
  }
  Error open_error() {
    auto opened = GpioTrigger::open(chips_, lines_);
    return opened ? Error{Errc::kInternal, "was opened"} : opened.error();
  }
  void start(const TriggerSettings& settings) {
    if (const Status started = trigger_->start(settings); !started) throw std::runtime_error(started.error().text());
  }
  std::vector<TriggerEdge> edges() {
    std::vector<TriggerEdge> all;
    for (;;) {
      const auto edge = trigger_->take_edge();
      if (!edge) throw std::runtime_error(edge.error().text());
      if (!*edge) return all;
      all.push_back(**edge);
    }
  }
  std::vector<TriggerEdge> edges_during(Duration time) {
    std::vector<TriggerEdge> all;
    for (int i = 0; i < 100; ++i) {
      chips_.pass(time / 100);
      for (const TriggerEdge& edge : edges()) all.push_back(edge);
    }
    return all;
  }
  /// The times at which the line changed to a level.
  std::vector<Instant> changes(std::uint32_t offset, bool high) {
    std::vector<Instant> all;
    for (const LineEvent& event : chips_.history(line(offset))) {
      if (event.high == high) all.push_back(event.at);
    }
    return all;
  }

  test::GpioChips chips_;
  TriggerLines lines_;
  std::unique_ptr<GpioTrigger> trigger_;
};

inline void expect_says(const Error& error, Errc code, const std::vector<std::string>& words) {
  EXPECT_EQ(error.code, code) << error.message;
  for (const std::string& word : words) EXPECT_NE(error.message.find(word), std::string::npos) << error.message;
}

}  // namespace nodal::hal::gpio
