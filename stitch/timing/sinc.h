// Interpolation of band-limited sequences between their samples.
#pragma once

#include <span>
#include <vector>

namespace nodal::timing {

/// Bessel's function I0, of Kaiser's window.
double bessel_i0(double x);
/// Kaiser's window at `x`, -1 .. 1; 0 outside.
double kaiser(double x, double beta);

/// A sinc under Kaiser's window, for sequences without anything above 0.4 of their rate: errors are below 0.001 of the
/// largest sample there.
///
/// Threading: immutable.
class SincTable {
 public:
  SincTable();
  /// The sequence at `place` (0: the first sample's); samples outside are 0.
  double value(std::span<const double> samples, double place) const;
  double value(std::span<const float> samples, double place) const;

 private:
  template <class Sample>
  double sum(std::span<const Sample> samples, double place) const;
  std::vector<double> weights_;  // kTaps for each of kSteps + 1 fractions of a sample
};

}  // namespace nodal::timing
