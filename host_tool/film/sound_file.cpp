#include "host_tool/film/sound_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <vector>

#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::film {
namespace {

constexpr float kFull = 32767;

std::int16_t stored(float sample) {
  if (sample == 0) return 0;
  const float level = std::round(std::clamp(sample, -1.0F, 1.0F) * kFull);
  return static_cast<std::int16_t>(level != 0 ? level : sample > 0 ? 1.0F : -1.0F);
}

}  // namespace

Result<std::shared_ptr<timing::SoundStore>> SoundFile::make(const std::string& folder) {
  const Result<int> descriptor = open_unnamed(folder);
  if (!descriptor) return fail(descriptor.error().in(folder));
  return std::make_shared<SoundFile>(*descriptor, folder);
}

SoundFile::~SoundFile() { ::close(descriptor_); }

Error SoundFile::failed(int error) const {
  const char* const what = error == ENOSPC ? "the disk is full" : std::strerror(error);
  return {error == ENOSPC ? Errc::kDiskFull : Errc::kIo,
          fmt::format("{}: the films' sound is kept here while it is compared: {}", folder_, what)};
}

Status SoundFile::append(std::span<const float> samples) {
  std::vector<std::int16_t> words(samples.size());
  std::ranges::transform(samples, words.begin(), stored);
  const auto* at = reinterpret_cast<const std::uint8_t*>(words.data());
  for (std::size_t left = words.size() * sizeof words[0]; left > 0;) {
    const ssize_t count = ::write(descriptor_, at, left);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return tl::unexpected<Error>(failed(count < 0 ? errno : ENOSPC));
    at += count;
    left -= static_cast<std::size_t>(count);
  }
  return {};
}

Status SoundFile::read(std::int64_t first, std::span<float> into) const {
  std::vector<std::int16_t> words(into.size());
  auto* at = reinterpret_cast<std::uint8_t*>(words.data());
  auto place = static_cast<off_t>(first) * static_cast<off_t>(sizeof words[0]);
  for (std::size_t left = words.size() * sizeof words[0]; left > 0;) {
    const ssize_t count = ::pread(descriptor_, at, left, place);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return tl::unexpected<Error>(failed(count < 0 ? errno : EIO));
    at += count;
    place += count;
    left -= static_cast<std::size_t>(count);
  }
  std::ranges::transform(words, into.begin(), [](std::int16_t word) { return static_cast<float>(word) / kFull; });
  return {};
}

}  // namespace nodal::film
