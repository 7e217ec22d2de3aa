// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include <vector>

#include "base/mesh.h"

namespace veneer::render {

/// The unit tangent of every vertex, in the mesh's frame: dP/du, made orthogonal to the normal.
/// With z the normal and y = z cross x it is the x axis of the local frame in which materials are
/// evaluated (docs/CONVENTIONS.md).
///
/// dP/du is averaged over the triangles that share the vertex, weighted by their area. A triangle
/// whose corners span no area in texture space has no dP/du and is left out. A vertex for which
/// nothing is left (or whose sum cancels or runs along the normal) gets the mesh's x axis projected
/// into the tangent plane, or its y axis where the normal runs within 25 degrees of x.
[[nodiscard]] std::vector<Eigen::Vector3d> vertex_tangents(const Mesh& mesh);

}  // namespace veneer::render
