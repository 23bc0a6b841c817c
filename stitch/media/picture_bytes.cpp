#include "stitch/media/picture_bytes.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace nodal::media {

PictureBytes::PictureBytes(std::string name, FilePtr file, std::uint64_t size)
    : name_(std::move(name)), file_(std::move(file)), size_(size) {}

Result<PictureBytes> PictureBytes::open(const std::filesystem::path& file) {
  Result<FilePtr> in = open_to_read(file);
  if (!in) {
    const bool wrong_kind = in.error().code == Errc::kBadFormat;
    return fail(in.error().code,
                "picture '" + file.string() + "': " + (wrong_kind ? "" : "cannot be opened: ") + in.error().message);
  }
  struct stat about {};
  if (::fstat(::fileno(in->get()), &about) != 0) {
    return fail(Errc::kIo, "picture '" + file.string() + "': cannot be read: " + std::strerror(errno));
  }
  return PictureBytes(file.string(), std::move(*in), static_cast<std::uint64_t>(about.st_size));
}

int PictureBytes::descriptor() const { return ::fileno(file_.get()); }

Result<std::span<const std::uint8_t>> PictureBytes::first(std::size_t count) {
  const auto wanted = static_cast<std::size_t>(std::min<std::uint64_t>(count, size_));
  while (bytes_.size() < wanted) {
    const std::size_t have = bytes_.size();
    bytes_.resize(wanted);
    const ssize_t got = ::pread(descriptor(), bytes_.data() + have, wanted - have, static_cast<off_t>(have));
    bytes_.resize(have + (got > 0 ? static_cast<std::size_t>(got) : 0));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return fail(Errc::kIo, "picture '" + name_ + "': cannot be read: " + std::strerror(errno));
    if (got == 0) break;  // the file was cut meanwhile
  }
  return std::span<const std::uint8_t>(bytes_).first(std::min(wanted, bytes_.size()));
}

std::vector<std::uint8_t> PictureBytes::take() { return std::exchange(bytes_, {}); }

}  // namespace nodal::media
