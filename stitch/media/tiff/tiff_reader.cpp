#include "stitch/media/tiff/tiff_reader.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/limits.h"
#include "stitch/media/tiff/memory.h"

namespace nodal::media {
namespace {

constexpr std::uint32_t kMostSide = 32768;
/// Decoded bytes per byte of file. Deflate expands at most 1032 times, LZW and runs of one colour less.
constexpr std::uint64_t kMostExpansion = 3096;
constexpr std::uint64_t kMostBlock = std::uint64_t{1} << 30;  // bytes of a strip or a tile
constexpr std::uint64_t kSmall = std::uint64_t{1} << 20;      // bytes; a picture this small may claim any expansion

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

/// A file and what libtiff says of it.
struct Reader {
  std::string name;
  std::uint64_t file_bytes = 0;
  TiffMemory memory{};
  TiffPtr tiff{};
  ImageHeader header{};

  Error error(Errc code, const std::string& text) const { return {code, "picture '" + name + "': " + text}; }
  Error broken(Errc code, const std::string& how) const {
    return error(code, "the TIFF " + how + " (" + memory.why + "); fetch or export it again");
  }
};

template <class Value>
Value field(TIFF* tiff, std::uint32_t tag, Value otherwise) {
  Value value = otherwise;
  return TIFFGetFieldDefaulted(tiff, tag, &value) == 1 ? value : otherwise;
}

Status check_size(Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  const auto width = field<std::uint32_t>(tiff, TIFFTAG_IMAGEWIDTH, 0);
  const auto height = field<std::uint32_t>(tiff, TIFFTAG_IMAGELENGTH, 0);
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width == 0 || height == 0) return fail(reader.error(Errc::kBadFormat, "the TIFF has " + size + " pixels"));
  if (width > kMostSide || height > kMostSide) {
    return fail(
        reader.error(Errc::kTooLarge, "is " + size + ", over the limit of " + std::to_string(kMostSide) + " a side"));
  }
  if (std::uint64_t{width} * height > kMaxPicturePixels) {
    return fail(reader.error(Errc::kTooLarge, "is " + size + ", over the limit of " +
                                                  std::to_string(kMaxPicturePixels >> 20) + " * 2^20 pixels"));
  }
  if (std::uint64_t{width} * height * 3 > kSmall + kMostExpansion * reader.file_bytes) {
    return fail(reader.error(Errc::kTruncated, std::to_string(reader.file_bytes) + " bytes cannot hold " + size +
                                                   " pixels; fetch or export it again"));
  }
  const auto light = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
  const bool grey = light == PHOTOMETRIC_MINISBLACK || light == PHOTOMETRIC_MINISWHITE;
  reader.header = {static_cast<int>(width), static_cast<int>(height), grey ? PixelFormat::kGrey8 : PixelFormat::kRgb24};
  return {};
}

using File = std::unique_ptr<std::FILE, CloseFile>;

Result<File> open_file(const std::filesystem::path& file, Reader& reader) {
  File in(std::fopen(file.c_str(), "rb"));
  if (!in) {
    return fail(reader.error(errno == ENOENT || errno == ENOTDIR ? Errc::kNotFound : Errc::kIo,
                             std::string("cannot be opened: ") + std::strerror(errno)));
  }
  return in;
}

Error too_large(const Reader& reader) {
  return reader.error(Errc::kTooLarge, "is over " + std::to_string(kMaxTiffFileBytes >> 20) + " MiB");
}

Status open(const std::filesystem::path& file, Reader& reader) {
  const Result<File> in = open_file(file, reader);
  if (!in) return fail(in.error());
  std::vector<std::uint8_t>& bytes = reader.memory.bytes;
  std::vector<std::uint8_t> piece(std::size_t{1} << 16);
  while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), in->get())) {
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
    if (bytes.size() > kMaxTiffFileBytes) return fail(too_large(reader));
  }
  if (std::ferror(in->get()) != 0) {
    return fail(reader.error(Errc::kIo, std::string("cannot be read: ") + std::strerror(errno)));
  }
  reader.file_bytes = bytes.size();
  reader.tiff = open_tiff(reader.memory, "r");
  if (!reader.tiff) return fail(reader.broken(Errc::kBadFormat, "is broken"));
  return check_size(reader);
}

/// Reads only the file's directory.
Status open_directory(const std::filesystem::path& file, Reader& reader) {
  const Result<File> in = open_file(file, reader);
  if (!in) return fail(in.error());
  std::error_code unknown;
  reader.file_bytes = std::filesystem::file_size(file, unknown);
  if (unknown) return fail(reader.error(Errc::kIo, "cannot be read: " + unknown.message()));
  if (reader.file_bytes > kMaxTiffFileBytes) return fail(too_large(reader));
  const int descriptor = ::dup(fileno(in->get()));
  if (descriptor < 0) return fail(reader.error(Errc::kIo, std::string("cannot be read: ") + std::strerror(errno)));
  reader.tiff = open_tiff_file(descriptor, reader.memory);
  if (!reader.tiff) return fail(reader.broken(Errc::kBadFormat, "is broken"));
  return check_size(reader);
}

bool is_deep_grey(const Reader& reader) {
  TIFF* tiff = reader.tiff.get();
  return reader.header.natural == PixelFormat::kGrey8 && field<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE, 1) == 16 &&
         field<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL, 1) == 1 &&
         field<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT) == SAMPLEFORMAT_UINT;
}

/// Grey of 16 bits, which libtiff 4.5 converts wrongly in tiles that reach beyond the picture.
Status decode_deep_grey(Reader& reader, std::vector<std::uint8_t>& bytes) {
  TIFF* tiff = reader.tiff.get();
  const bool tiled = TIFFIsTiled(tiff) != 0;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const auto across = tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH, 0) : width;
  const auto down = tiled ? field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)
                          : std::min(height, field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height));
  const tmsize_t size = tiled ? TIFFTileSize(tiff) : TIFFStripSize(tiff);
  const std::uint64_t wanted = std::uint64_t{2} * across * down;
  if (across == 0 || down == 0 || size <= 0 || wanted > kMostBlock || static_cast<std::uint64_t>(size) < wanted) {
    return fail(reader.error(Errc::kUnsupported, "the TIFF has unusual strips or tiles; export it again"));
  }
  const bool white_is_0 = field<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC, 0) == PHOTOMETRIC_MINISWHITE;
  std::vector<std::uint16_t> block(static_cast<std::size_t>(size) / 2 + 1);
  bytes.resize(std::size_t{width} * height);
  std::uint32_t number = 0;
  for (std::uint32_t top = 0; top < height; top += down) {
    for (std::uint32_t left = 0; left < width; left += across, ++number) {
      const tmsize_t got = tiled ? TIFFReadEncodedTile(tiff, number, block.data(), size)
                                 : TIFFReadEncodedStrip(tiff, number, block.data(), size);
      const std::uint32_t rows = std::min(down, height - top);
      if (got < static_cast<tmsize_t>(2 * std::size_t{across} * rows)) {
        return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
      }
      for (std::uint32_t y = 0; y < rows; ++y) {
        for (std::uint32_t x = 0; x < std::min(across, width - left); ++x) {
          const unsigned value = (block[std::size_t{y} * across + x] + 128U) / 257U;
          bytes[std::size_t{top + y} * width + left + x] = static_cast<std::uint8_t>(white_is_0 ? 255U - value : value);
        }
      }
    }
  }
  return {};
}

/// libtiff's own conversion to 8 bits: red in the lowest byte. Rows are appended to `bytes` as they are decoded, those of
/// a row of strips or tiles at a time, so that a file that ends early takes no memory for the rest.
Status decode(Reader& reader, std::vector<std::uint8_t>& bytes) {
  TIFF* tiff = reader.tiff.get();
  TIFFRGBAImage image{};
  std::array<char, 1024> why{};
  if (TIFFRGBAImageOK(tiff, why.data()) == 0 || TIFFRGBAImageBegin(&image, tiff, 1, why.data()) == 0) {
    return fail(reader.error(Errc::kUnsupported, std::string("this kind of TIFF cannot be read (") + why.data() +
                                                     "); export it with 8 or 16 bits"));
  }
  const std::unique_ptr<TIFFRGBAImage, decltype(&TIFFRGBAImageEnd)> end(&image, TIFFRGBAImageEnd);
  image.req_orientation = image.orientation;
  const auto width = static_cast<std::uint32_t>(reader.header.width);
  const auto height = static_cast<std::uint32_t>(reader.header.height);
  const bool grey = reader.header.natural == PixelFormat::kGrey8;
  const auto stored = TIFFIsTiled(tiff) != 0 ? field<std::uint32_t>(tiff, TIFFTAG_TILELENGTH, 0)
                                             : field<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP, height);
  const std::uint32_t at_once = std::clamp(stored, std::uint32_t{1}, height);
  std::vector<std::uint32_t> pixels(std::size_t{width} * at_once);
  for (std::uint32_t top = 0; top < height; top += at_once) {
    const std::uint32_t rows = std::min(at_once, height - top);
    image.row_offset = static_cast<int>(top);
    if (TIFFRGBAImageGet(&image, pixels.data(), width, rows) != 1) {
      return fail(reader.broken(Errc::kTruncated, "ends early or is broken"));
    }
    for (const std::uint32_t pixel : std::span(pixels).first(std::size_t{width} * rows)) {
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetR(pixel)));
      if (grey) continue;
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetG(pixel)));
      bytes.push_back(static_cast<std::uint8_t>(TIFFGetB(pixel)));
    }
  }
  return {};
}

}  // namespace

bool is_tiff(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return false;
  const std::unique_ptr<std::FILE, CloseFile> in(std::fopen(file.c_str(), "rb"));
  std::array<char, 4> first{};
  if (!in || std::fread(first.data(), 1, first.size(), in.get()) != first.size()) return false;
  const std::string_view start(first.data(), first.size());
  using namespace std::string_view_literals;
  return start == "II*\0"sv || start == "MM\0*"sv || start == "II+\0"sv || start == "MM\0+"sv;
}

Result<ImageHeader> read_tiff_header(const std::filesystem::path& file) {
  Reader reader{file.string()};
  if (const Status opened = open_directory(file, reader); !opened) return fail(opened.error());
  return reader.header;
}

Result<DecodedImage> read_tiff(const std::filesystem::path& file) {
  Reader reader{file.string()};
  if (const Status opened = open(file, reader); !opened) return fail(opened.error());
  if (is_deep_grey(reader)) {
    DecodedImage grey{PixelFormat::kGrey8, reader.header.width, reader.header.height, {}};
    if (const Status decoded = decode_deep_grey(reader, grey.bytes); !decoded) return fail(decoded.error());
    return grey;
  }
  DecodedImage picture{reader.header.natural, reader.header.width, reader.header.height, {}};
  picture.bytes.reserve(packed_size(picture.format, picture.width, picture.height));
  if (const Status decoded = decode(reader, picture.bytes); !decoded) return fail(decoded.error());
  return picture;
}

}  // namespace nodal::media
