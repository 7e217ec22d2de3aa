// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "btf/importers/importer.h"

namespace veneer::btf {

/// A BTF compressed by multi-level vector quantisation, as text code-books, decoded at the 81 x 81
/// directions of the Bonn measurements.
///
/// Values 0 to 255 are gamma-encoded and hold the light's cosine: they are cut to [0, 1] and raised
/// to 2.2, which brings them to the sample's unit up to the exposure of the measurement.
/// Source: Havran, Filip, Myszkowski 2010, "Bidirectional Texture Function Compression Based on
/// Multi-Level Vector Quantization"; the files' layout in code_books.h.
///
/// @param source  the folder of one material.
/// Errors: kNotFound (a missing table), kBadFormat (names the table: truncated, no number, an index
/// out of range), kInvalidOption (the crop).
[[nodiscard]] Status import_btfbase(const std::filesystem::path& source,
                                    const std::filesystem::path& set,
                                    const ImportOptions& options,
                                    Progress& progress);

}  // namespace veneer::btf
