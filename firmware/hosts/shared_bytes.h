#pragma once

#include <memory>

#include "protocol/base/loan.h"
#include "protocol/bulk.h"

namespace nodal::firmware {

/// The loan's bytes in the type that sessions send; the loan ends with the last copy.
template <class Bytes>
SharedBytes shared_bytes(const Loan<Bytes>& loan) {
  if (!loan) return {};
  return {std::make_shared<const Loan<Bytes>>(loan), *loan};
}

}  // namespace nodal::firmware
