// Fourier transforms of real sequences, and what is made of them: correlations, and spectra of equal height.
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace nodal::timing {

/// The smallest length >= `n` for which the transform is quick: 4, times powers of 2, 3 and 5.
std::size_t quick_length(std::size_t n);

/// Transforms of one length.
///
/// Threading: thread-bound; its buffers are reused.
class Fourier {
 public:
  /// `length`: a multiple of 4.
  explicit Fourier(std::size_t length);
  ~Fourier();
  Fourier(Fourier&&) noexcept;

  std::size_t length() const { return length_; }
  /// The spectrum, length() / 2 + 1 values, of `samples`, at most length() of them; zeros follow.
  std::vector<std::complex<double>> forward(std::span<const double> samples);
  /// The inverse, scaled so that inverse(forward(x)) = x.
  std::vector<double> inverse(const std::vector<std::complex<double>>& spectrum);

 private:
  struct Plan;
  std::size_t length_;
  Plan* plan_;
};

/// sum_i a[i] b[i + k] for k = 0 .. b.size() - a.size(): every place of `a` wholly inside `b`. Empty if `a` is empty or
/// longer than `b`.
std::vector<double> correlate(std::span<const double> a, std::span<const double> b);

/// The same divided by the norms of `a` and of the part of `b` under it: the correlation coefficient of sequences
/// without a mean. 0 where either is 0.
std::vector<double> correlation_coefficients(std::span<const double> a, std::span<const double> b);

}  // namespace nodal::timing
