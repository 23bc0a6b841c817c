#include "stitch/media/linear_words.h"

#include <fmt/format.h>

#include <charconv>

namespace nodal::media {

namespace {
constexpr std::string_view kFullExposure = "full_exposure_ns=";
}

std::string linear_comment(const SampleMeaning& meaning) {
  if (!meaning.is_linear()) return {};
  std::string comment(kLinearWords);
  if (meaning.full_exposure_ns) {
    comment += fmt::format(" {}{}: at 0 dB, the shutter by which the light of 65535 fills a sample.", kFullExposure,
                           *meaning.full_exposure_ns);
  }
  return comment;
}

std::optional<std::uint64_t> full_exposure_said(std::string_view comment) {
  const std::size_t at = comment.find(kFullExposure);
  if (!comment.starts_with(kLinearWords) || at == std::string_view::npos) return std::nullopt;
  std::uint64_t value = 0;
  const char* const from = comment.data() + at + kFullExposure.size();
  const auto [end, error] = std::from_chars(from, comment.data() + comment.size(), value);
  if (error != std::errc()) return std::nullopt;
  return value;
}

}  // namespace nodal::media
