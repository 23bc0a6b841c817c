#include "stitch/timing/fourier.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "protocol/base/result.h"

namespace nodal::timing {

std::size_t quick_length(std::size_t n) {
  for (std::size_t quarter = std::max<std::size_t>(1, (n + 3) / 4);; ++quarter) {
    std::size_t rest = quarter;
    for (const std::size_t factor : {2U, 3U, 5U}) {
      while (rest % factor == 0) rest /= factor;
    }
    if (rest == 1) return 4 * quarter;
  }
}

struct Fourier::Plan {
  Eigen::FFT<double> fft{Eigen::default_fft_impl<double>(), Eigen::FFT<double>::HalfSpectrum};
  std::vector<double> samples{};
};

Fourier::Fourier(std::size_t length) : length_(length), plan_(new Plan) {
  NODAL_ASSERT(length > 0 && length % 4 == 0);
  plan_->samples.resize(length);
}
Fourier::~Fourier() { delete plan_; }
Fourier::Fourier(Fourier&& other) noexcept : length_(other.length_), plan_(std::exchange(other.plan_, nullptr)) {}

std::vector<std::complex<double>> Fourier::forward(std::span<const double> samples) {
  NODAL_ASSERT(samples.size() <= length_);
  std::ranges::copy(samples, plan_->samples.begin());
  std::fill(plan_->samples.begin() + static_cast<std::ptrdiff_t>(samples.size()), plan_->samples.end(), 0.0);
  std::vector<std::complex<double>> spectrum(length_ / 2 + 1);
  plan_->fft.fwd(spectrum.data(), plan_->samples.data(), static_cast<Eigen::Index>(length_));
  return spectrum;
}

std::vector<double> Fourier::inverse(const std::vector<std::complex<double>>& spectrum) {
  NODAL_ASSERT(spectrum.size() == length_ / 2 + 1);
  std::vector<double> samples(length_);
  plan_->fft.inv(samples.data(), spectrum.data(), static_cast<Eigen::Index>(length_));
  return samples;
}

std::vector<double> correlate(std::span<const double> a, std::span<const double> b) {
  if (a.empty() || a.size() > b.size()) return {};
  // A circular correlation of b's length is right wherever `a` does not reach over the end.
  const std::size_t length = quick_length(b.size());
  thread_local std::optional<Fourier> kept;  // its tables take longer than a transform
  if (!kept || kept->length() != length) kept.emplace(length);
  Fourier& fourier = *kept;
  const auto spectrum_a = fourier.forward(a);
  auto product = fourier.forward(b);
  for (std::size_t i = 0; i < product.size(); ++i) product[i] *= std::conj(spectrum_a[i]);
  std::vector<double> sums = fourier.inverse(product);
  sums.resize(b.size() - a.size() + 1);
  return sums;
}

std::vector<double> correlation_coefficients(std::span<const double> a, std::span<const double> b) {
  std::vector<double> sums = correlate(a, b);
  double norm_a = 0, total_b = 0;
  for (const double x : a) norm_a += x * x;
  std::vector<double> before(b.size() + 1, 0.0);
  for (std::size_t i = 0; i < b.size(); ++i) before[i + 1] = before[i] + b[i] * b[i];
  total_b = before.back();
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const double norm_b = before[k + a.size()] - before[k];
    const bool nothing = norm_a <= 0 || norm_b <= 1e-12 * total_b;
    sums[k] = nothing ? 0.0 : sums[k] / std::sqrt(norm_a * norm_b);
  }
  return sums;
}

}  // namespace nodal::timing
