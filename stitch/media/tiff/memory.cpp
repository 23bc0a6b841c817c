#include "stitch/media/tiff/memory.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>

namespace nodal::media {
namespace {

constexpr tmsize_t kMaxAtOnce = tmsize_t{1} << 30;  // bytes that libtiff may allocate at once, for a strip or a tile

TiffMemory& memory_of(thandle_t handle) { return *static_cast<TiffMemory*>(handle); }

tmsize_t read_from(thandle_t handle, void* into, tmsize_t count) {
  TiffMemory& memory = memory_of(handle);
  const std::size_t rest = memory.bytes.size() - std::min(memory.at, memory.bytes.size());
  const std::size_t got = std::min(static_cast<std::size_t>(count), rest);
  if (got > 0) std::memcpy(into, memory.bytes.data() + memory.at, got);
  memory.at += got;
  return static_cast<tmsize_t>(got);
}

tmsize_t write_to(thandle_t handle, void* from, tmsize_t count) {
  TiffMemory& memory = memory_of(handle);
  const std::size_t end = memory.at + static_cast<std::size_t>(count);
  if (end > memory.bytes.size()) memory.bytes.resize(end);
  std::memcpy(memory.bytes.data() + memory.at, from, static_cast<std::size_t>(count));
  memory.at = end;
  return count;
}

toff_t seek_to(thandle_t handle, toff_t offset, int from) {
  TiffMemory& memory = memory_of(handle);
  const std::size_t base = from == SEEK_SET ? 0 : from == SEEK_CUR ? memory.at : memory.bytes.size();
  memory.at = base + static_cast<std::size_t>(offset);
  return memory.at;
}

int keep_open(thandle_t /*handle*/) { return 0; }
toff_t size_of(thandle_t handle) { return memory_of(handle).bytes.size(); }

int map_all(thandle_t handle, void** base, toff_t* size) {
  *base = memory_of(handle).bytes.data();
  *size = memory_of(handle).bytes.size();
  return 1;
}
void unmap(thandle_t /*handle*/, void* /*base*/, toff_t /*size*/) {}

int keep_error(TIFF* /*tiff*/, void* memory, const char* /*module*/, const char* format, va_list words) {
  std::array<char, 256> text{};
  std::vsnprintf(text.data(), text.size(), format, words);
  static_cast<TiffMemory*>(memory)->why = text.data();
  return 1;
}
int drop_warning(TIFF* /*tiff*/, void* /*memory*/, const char* /*module*/, const char* /*format*/, va_list /*words*/) {
  return 1;
}

std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options_for(TiffMemory& memory) {
  std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(), TIFFOpenOptionsFree);
  if (!options) return options;
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_error, &memory);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), drop_warning, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxAtOnce);
  return options;
}

}  // namespace

TiffPtr open_tiff_file(int descriptor, TiffMemory& memory) {
  const auto options = options_for(memory);
  TiffPtr tiff(options ? TIFFFdOpenExt(descriptor, "picture", "rm", options.get()) : nullptr);  // m: not mapped
  if (!tiff) ::close(descriptor);
  return tiff;
}

TiffPtr open_tiff(TiffMemory& memory, const char* mode) {
  const auto options = options_for(memory);
  if (!options) return nullptr;
  return TiffPtr(TIFFClientOpenExt("picture", mode, &memory, read_from, write_to, seek_to, keep_open, size_of, map_all,
                                   unmap, options.get()));
}

}  // namespace nodal::media
