#include "hal/linux/gpio/traced_system.h"

#include <fmt/format.h>

#include <cstring>
#include <utility>

namespace nodal::hal::gpio {
namespace {

constexpr const char* level_name(bool high) { return high ? "high" : "low"; }

class TracedLine final : public Line {
 public:
  TracedLine(std::unique_ptr<Line> line, std::string name, TraceLine write)
      : line_(std::move(line)), name_(std::move(name)), write_(std::move(write)) {}
  ~TracedLine() override {
    line_.reset();
    write_(name_ + ": released");
  }

  int set(bool high) override {
    const int error = line_->set(high);
    write_(fmt::format("{}: set {}{}", name_, level_name(high), error_text(error)));
    return error;
  }
  int get() override {
    const int level = line_->get();
    write_(fmt::format("{}: is {}", name_, level < 0 ? "not read" + error_text(-level) : level_name(level != 0)));
    return level;
  }
  int read_events(std::span<LineEvent> into) override {
    const int count = line_->read_events(into);
    if (count < 0) write_(fmt::format("{}: edges are not read{}", name_, error_text(-count)));
    for (int i = 0; i < count; ++i) {
      const LineEvent& event = into[static_cast<std::size_t>(i)];
      write_(fmt::format("{}: {} edge at {:.9f} s", name_, event.high ? "rising" : "falling",
                         static_cast<double>(event.at.ns()) / 1e9));
    }
    return count;
  }
  int descriptor() const override { return line_->descriptor(); }

 private:
  static std::string error_text(int error) {
    return error == 0 ? std::string() : fmt::format(" -> {}", ::strerrordesc_np(error));
  }

  std::unique_ptr<Line> line_;
  const std::string name_;
  const TraceLine write_;
};

}  // namespace

Claim TracedSystem::claim_output(const LineName& line, bool high) {
  return traced(line, system_.claim_output(line, high), fmt::format("an output, {}", level_name(high)));
}

Claim TracedSystem::claim_input(const LineName& line, const InputOptions& options) {
  return traced(line, system_.claim_input(line, options),
                options.active_low ? "an input, active when it is low" : "an input, active when it is high");
}

Claim TracedSystem::traced(const LineName& line, Claim claim, const std::string& as) const {
  if (!claim.line) {
    write_(fmt::format("{}: cannot be claimed as {} -> {}", line.text(), as, ::strerrordesc_np(claim.error)));
    return claim;
  }
  write_(fmt::format("{}: claimed as {}", line.text(), as));
  claim.line = std::make_unique<TracedLine>(std::move(claim.line), line.text(), write_);
  return claim;
}

}  // namespace nodal::hal::gpio
