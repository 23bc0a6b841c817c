#include "firmware/storage/file_pieces.h"

#include <algorithm>

#include "protocol/base/try.h"

namespace nodal::firmware {

Result<std::span<const std::uint8_t>> FilePieces::next() {
  if (at_ >= end_) return std::span<const std::uint8_t>();
  if (!file_) {
    NODAL_TRY_ASSIGN(const auto opened, disk_.open_read(name_));
    file_ = opened;
    piece_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kPiece, end_ - at_)));
  }
  const std::span into =
      std::span(piece_).first(static_cast<std::size_t>(std::min<std::uint64_t>(piece_.size(), end_ - at_)));
  const auto read = disk_.read_at(*file_, at_, into);
  if (!read || *read == 0) close();
  if (!read) return fail(read.error());
  at_ += *read;
  return std::span<const std::uint8_t>(into.first(*read));
}

Result<std::string_view> FilePieces::next_text() {
  NODAL_TRY_ASSIGN(const auto piece, next());
  return std::string_view(reinterpret_cast<const char*>(piece.data()), piece.size());
}

void FilePieces::close() {
  if (file_) disk_.close(*file_);
  file_.reset();
}

Status for_each_piece(FilePieces& pieces, const std::function<bool(std::span<const std::uint8_t>)>& each) {
  for (;;) {
    NODAL_TRY_ASSIGN(const auto piece, pieces.next());
    if (piece.empty() || !each(piece)) return {};
  }
}

}  // namespace nodal::firmware
