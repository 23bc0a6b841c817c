// A Kalman filter that estimates an offset and its drift from noisy measurements.
#pragma once

#include "protocol/base/units.h"

namespace nodal::firmware {

// The filter's units.
inline double us_of(Duration d) { return static_cast<double>(d.ns()) / 1000; }
inline double seconds_of(Duration d) { return static_cast<double>(d.ns()) / 1e9; }

/// State: offset in us and drift in ppm, which is us/s. Between two measurements the offset grows by drift x time, and
/// the drift is a random walk of `noise` ppm^2/s; the covariance of that over t is noise x [t^3/3, t^2/2; t^2/2, t]
/// (the "continuous white-noise acceleration" model: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to
/// Tracking and Navigation, section 6.2.2). Uses only + - * / on doubles, so that every machine computes the same.
///
/// Threading: thread-bound.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class OffsetFilter {
 public:
  /// Starts with a first measurement; the drift is unknown within the limits of crystals.
  void restart(double offset_us, double variance_us2, double drift_variance_ppm2) {
    *this = {};
    offset_ = offset_us;
    p_offset_ = variance_us2;
    p_drift_ = drift_variance_ppm2;
  }
  /// Keeps the estimate of the drift, and starts a new offset with its first measurement.
  void restart_offset(double offset_us, double variance_us2) {
    offset_ = offset_us;
    p_offset_ = variance_us2;
    p_both_ = 0;
  }
  /// Predicts the state `seconds` later; `seconds` is not negative.
  void predict(double seconds, double noise_ppm2_per_s) {
    const double t = seconds;
    offset_ += drift_ * t;
    p_offset_ += t * (2 * p_both_ + t * p_drift_) + noise_ppm2_per_s * t * t * t / 3;
    p_both_ += t * p_drift_ + noise_ppm2_per_s * t * t / 2;
    p_drift_ += noise_ppm2_per_s * t;
  }
  /// Takes a measurement of the offset with this variance into account.
  void update(double offset_us, double variance_us2) {
    const double innovation = offset_us - offset_;
    const double of_innovation = p_offset_ + variance_us2;
    const double gain = p_offset_ / of_innovation, drift_gain = p_both_ / of_innovation;
    offset_ += gain * innovation;
    drift_ += drift_gain * innovation;
    p_drift_ -= drift_gain * p_both_;
    p_both_ -= gain * p_both_;
    p_offset_ -= gain * p_offset_;
  }
  /// The offset was changed on purpose by a known amount.
  void move(double by_us) { offset_ += by_us; }

  double offset_us() const { return offset_; }
  double variance_us2() const { return p_offset_; }  ///< variance of offset_us()
  double drift_ppm() const { return drift_; }
  double drift_variance_ppm2() const { return p_drift_; }

 private:
  double offset_ = 0, drift_ = 0;
  double p_offset_ = 0, p_both_ = 0, p_drift_ = 0;  ///< covariance
};

}  // namespace nodal::firmware
