#version 450
// Colour, position and entity of a pixel in one pass: lamps from afar and light from everywhere,
// no shadows. What a picture costs without a GPU is the work of each pixel.

layout(constant_id = 0) const int NUM_DIRECTIONAL_LIGHTS = 0;

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

layout(set = 2, binding = 0) uniform MaterialBuffer {
  vec4 emission;
  vec4 baseColor;
  float fresnel;
  float roughness;
  float metallic;
  float transmission;
  float ior;
  float transmissionRoughness;
  int textureMask;
  int padding1;
  vec4 textureTransforms[6];
} materialBuffer;

layout(set = 2, binding = 1) uniform sampler2D colorTexture;
layout(set = 2, binding = 2) uniform sampler2D roughnessTexture;
layout(set = 2, binding = 3) uniform sampler2D normalTexture;
layout(set = 2, binding = 4) uniform sampler2D metallicTexture;
layout(set = 2, binding = 5) uniform sampler2D emissionTexture;
layout(set = 2, binding = 6) uniform sampler2D transmissionTexture;

struct PointLight {
  vec4 position;
  vec4 emission;
};
struct DirectionalLight {
  vec4 direction;
  vec4 emission;
};
struct SpotLight {
  vec4 position;
  vec4 direction;
  vec4 emission;
};

layout(set = 3, binding = 0) uniform SceneBuffer {
  vec4 ambientLight;
  PointLight pointLights[10];
  DirectionalLight directionalLights[3];
  SpotLight spotLights[10];
  SpotLight texturedLights[1];
} sceneBuffer;

layout(location = 0) in vec3 positionCamera;
layout(location = 1) in vec3 normalCamera;
layout(location = 2) in vec2 texturePlace;
layout(location = 3) in flat uint entity;

layout(location = 0) out vec4 outColor;
layout(location = 1) out ivec4 outPositionSegmentation;

const float PI = 3.14159265;

// Reflected share of a lamp's light off a rough surface: microfacets by the distribution of
// Trowbridge and Reitz, masked as by Schlick, with his Fresnel term.
vec3 reflected(float toLight, float toEye, float toHalf, float halfToEye, float rough, vec3 straight) {
  float a2 = rough * rough * rough * rough;
  float k = (rough + 1.0) * (rough + 1.0) / 8.0;
  float spread = toHalf * toHalf * (a2 - 1.0) + 1.0;
  vec3 fresnel = straight + (1.0 - straight) * pow(1.0 - halfToEye, 5.0);
  float masked = (toEye * (1.0 - k) + k) * (toLight * (1.0 - k) + k);
  return fresnel * a2 / max(4.0 * PI * spread * spread * masked, 1e-6);
}

void main() {
  vec4 base = materialBuffer.baseColor;
  if ((materialBuffer.textureMask & 1) != 0) {
    base = texture(colorTexture, texturePlace);
  }
  vec3 diffuse = base.rgb * (1.0 - materialBuffer.metallic);
  vec3 straight = mix(vec3(0.08 * materialBuffer.fresnel), base.rgb, materialBuffer.metallic);
  vec3 normal = normalize(normalCamera);
  vec3 eye = -normalize(positionCamera);
  float toEye = clamp(dot(normal, eye), 1e-6, 1.0);

  vec3 color = materialBuffer.emission.rgb + sceneBuffer.ambientLight.rgb * base.rgb;
  for (int i = 0; i < NUM_DIRECTIONAL_LIGHTS; ++i) {
    vec3 light = -normalize(mat3(cameraBuffer.viewMatrix) * sceneBuffer.directionalLights[i].direction.xyz);
    float toLight = dot(normal, light);
    if (toLight > 0.0) {
      vec3 middle = normalize(light + eye);
      vec3 share = diffuse / PI + reflected(
          toLight, toEye, clamp(dot(normal, middle), 0.0, 1.0), clamp(dot(eye, middle), 0.0, 1.0),
          materialBuffer.roughness, straight);
      color += sceneBuffer.directionalLights[i].emission.rgb * toLight * share;
    }
  }
  outColor = vec4(pow(clamp(color, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
  // Whole millimetres, to the nearest.
  outPositionSegmentation = ivec4(ivec3(round(positionCamera * 1000.0)), int(entity));
}
