#version 450
// Where a vertex and its normal are, in the world and seen from the camera.
// Names, sets and bindings are those by which SAPIEN fills the buffers.

layout(set = 0, binding = 0) uniform CameraBuffer {
  mat4 viewMatrix;
  mat4 projectionMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrixInverse;
  float width;
  float height;
} cameraBuffer;

layout(set = 1, binding = 0) uniform ObjectTransformBuffer {
  mat4 modelMatrix;
} objectTransformBuffer;

layout(set = 1, binding = 1) uniform ObjectDataBuffer {
  uvec4 segmentation;
  float transparency;
  int shadeFlat;
} objectDataBuffer;

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 tangent;
layout(location = 4) in vec3 bitangent;

layout(location = 0) out vec3 positionWorld;
layout(location = 1) out vec3 normalWorld;
layout(location = 2) out vec2 texturePlace;

void main() {
  vec4 world = objectTransformBuffer.modelMatrix * vec4(position, 1.0);
  positionWorld = world.xyz;
  // A turn and a scale along each axis: normals shrink where lengths grow.
  mat3 model = mat3(objectTransformBuffer.modelMatrix);
  vec3 scale2 = vec3(dot(model[0], model[0]), dot(model[1], model[1]), dot(model[2], model[2]));
  normalWorld = normalize(model * (normal / scale2));
  texturePlace = uv;
  gl_Position = cameraBuffer.projectionMatrix * (cameraBuffer.viewMatrix * world);
}
