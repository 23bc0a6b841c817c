// Steps capture through a flight record: its ports answer what they answered then, and what it does is compared.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "firmware/capture/capture.h"
#include "firmware/capture/capture_log.h"
#include "firmware/config/config.h"
#include "flight_reader.h"
#include "hal/head.h"
#include "hal/trigger.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::flight {

/// The first event that is not as recorded.
struct Difference {
  std::uint64_t event = 0;  ///< counted from 0
  Instant at;               ///< time of its step
  std::string place;
  std::string recorded;
  std::string now;
  std::string text() const;
};

/// Threading: thread-bound.
/// Ownership: the reader outlives it.
/// Errors: the reader's.
class FlightPlayer final : public firmware::CaptureLog {
 public:
  FlightPlayer(const firmware::RigConfig& config, FlightReader& reader);
  ~FlightPlayer() override;

  /// Called with every set that capture closes.
  std::function<void(const firmware::FrameSet&)> on_set;

  /// Until the end of the record, or the first difference.
  Result<std::optional<Difference>> play();
  std::uint64_t steps() const { return steps_; }
  std::uint64_t events() const { return done_; }
  Instant from() const { return from_; }
  Instant until() const { return now_; }

  // For capture.
  void note(firmware::CaptureEvent&& event) override;
  void collecting(std::uint32_t collection) override;

 private:
  class Head;
  class Heads;
  class Trigger;

  void step();
  void take_sets();
  /// The next recorded event if it is an E; then it is done.
  template <class E>
  std::optional<E> take_if(const std::function<bool(const E&)>& holds);
  /// Compares with the next recorded event, which is then done.
  void compare(const firmware::CaptureEvent& event);
  void differs(const std::string& place, const std::string& recorded, const std::string& now);

  const firmware::RigConfig config_;
  FlightReader& reader_;
  std::unique_ptr<Heads> heads_;
  std::unique_ptr<Trigger> trigger_;
  SpscRing<blend::SphereLight> light_;
  std::unique_ptr<firmware::Capture> capture_;
  firmware::Outlet<firmware::SetLoan>* sets_ = nullptr;
  std::map<std::uint64_t, firmware::SetLoan> held_;

  std::deque<firmware::CaptureEvent> step_;  ///< the events of this step that are not done
  std::uint64_t steps_ = 0;
  std::uint64_t done_ = 0;
  Instant from_, now_;
  bool over_ = false;
  std::optional<Difference> difference_;
};

}  // namespace nodal::flight
