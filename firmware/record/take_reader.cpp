#include "firmware/record/take_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::firmware {

static_assert(TakeReader::kPiece == take::PieceHashes::kPiece);

bool TakeReader::step() {
  if (recorder_.ring().used() > recorder_.ring().size() / 100 * kReadsUpTo) return false;
  if (orders_.empty()) return false;
  auto buffer = buffers_.take();
  if (!buffer) return false;
  const auto order = orders_.pop();
  const bool answered = answers_.push({order->transfer, order->offset, read(*order, std::move(buffer))});
  NODAL_ASSERT(answered);  // it has room for all orders
  return true;
}

Result<PieceOfTake> TakeReader::read(const ReadOrder& order, Loan<std::vector<std::uint8_t>> into) {
  if (!in_use_.begin_read()) {
    return fail(Errc::kNotReady, "the disk of the takes was ejected; mount it, or another one, and try again");
  }
  auto piece = read_there(order, std::move(into));
  in_use_.end_read();
  return piece;
}

Result<PieceOfTake> TakeReader::read_there(const ReadOrder& order, Loan<std::vector<std::uint8_t>> into) {
  if (!take::is_take_file(order.file)) {
    return fail(Errc::kBadValue, fmt::format("'{}' is no file of a take", printable(order.file, 64)));
  }
  const std::string folder = take::take_folder(order.take);
  if (!disk_.size(folder + "/" + take::kManifestFile)) {
    if (!disk_.size(folder + "/" + take::kTakeFile)) {
      return fail(Errc::kNotFound, fmt::format("there is no take {}; `nodal take list` lists them", order.take));
    }
    return fail(
        Errc::kWrongState,
        fmt::format("take {} is not finished; if it is being recorded, stop it first: nodal take stop", order.take));
  }
  const std::string name = folder + "/" + order.file;
  const auto size = disk_.size(name);
  if (!size && size.error().code == Errc::kNotFound) {
    return fail(Errc::kNotFound,
                fmt::format("take {} has no file {}; if the rig deleted it to make room, the same command "
                            "goes on with what is left",
                            order.take, order.file));
  }
  if (!size) return fail(size.error());
  if (order.offset > *size) {
    return fail(Errc::kBadValue,
                fmt::format("{} has {} bytes; nothing can be read from byte {} on", name, *size, order.offset));
  }
  NODAL_TRY_ASSIGN(const auto handle, disk_.open_read(name));
  into.edit().resize(std::min<std::uint64_t>(kPiece, *size - order.offset));
  const auto got = disk_.read_at(handle, order.offset, into.edit());
  disk_.close(handle);
  if (!got) return fail(got.error());
  if (*got != into->size()) return fail(Errc::kIo, fmt::format("{} became shorter while it was read", name));
  return PieceOfTake{*size, std::move(into)};
}

}  // namespace nodal::firmware
