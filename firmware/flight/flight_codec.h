// Capture's events as the messages of a flight record (protocol/take/flight.proto), and back.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/capture/capture_log.h"
#include "hal/head.h"
#include "protocol/base/field.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/flight.pb.h"

namespace nodal::firmware {

/// Times are stored relative to their step; settings and pictures of a head's frame only when they change. So events
/// must be encoded, and decoded, from the first on.
class FlightState {
 protected:
  struct Picture {
    PixelFormat format = PixelFormat::kI420;
    int width = 0;
    int height = 0;
    bool present = false;
    Fields fields = Fields::kProgressive;
    friend bool operator==(const Picture&, const Picture&) = default;
  };
  struct Head {
    hal::HeadSettings settings;
    std::optional<Picture> picture;  ///< empty: no frame yet
  };
  std::int64_t step_ns_ = 0;
  std::array<Head, kMaxHeads> heads_;
};

/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class FlightEncoder : FlightState {
 public:
  void encode(const CaptureEvent& event, take::flight::Event& to);

 private:
  void encode(const HeadDelivered& event, take::flight::Delivered& to);
};

/// Threading: thread-bound.
/// Ownership: none.
/// Errors: kBadFormat for a message that the encoder does not write, with what is wrong.
class FlightDecoder : FlightState {
 public:
  Result<CaptureEvent> decode(const take::flight::Event& from);

 private:
  Result<CaptureEvent> delivered(const take::flight::Delivered& from);
};

}  // namespace nodal::firmware
