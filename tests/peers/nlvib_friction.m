function u = nlvib_friction(file, direction, stiffness, limit, force, omega)
% Response of an exported body with one elastic dry friction element, by harmonic balance with one harmonic and time
% samples (as the harmonic-balance programs do it), from the fields that NLvib's constructor
%   MechanicalSystem(M, D, K, nonlinear_elements, Fex1)
% takes. u is (1, frequencies): complex displacement along the force direction, for exp(i omega t).
b = load(file);
b = b.speed_0;
element = struct('type', 'elasticDryFriction', 'stiffness', stiffness, 'friction_limit_force', limit, ...
                 'force_direction', b.W(:, strcmp(b.W_row, direction)), 'ishysteretic', 1);
system = struct('M', b.M, 'D', b.D, 'K', b.K, 'nonlinear_elements', {{element}}, 'Fex1', force * b.Fex1(:, 1));
w = system.nonlinear_elements{1}.force_direction;
u = zeros(1, length(omega));
for j = 1:length(omega)
  Z = -omega(j)^2 * system.M + 1i * omega(j) * system.D + system.K;
  free = w' * (Z \ system.Fex1);
  held = w' * (Z \ w);
  stuck = free / (1 + held * stiffness);
  residual = @(x) parts((complex(x(1), x(2)) - free + held * harmonic(complex(x(1), x(2)), element)) / abs(free));
  options = optimset('TolX', 1e-14, 'TolFun', 1e-14, 'MaxIter', 200);
  [x, left] = fsolve(residual, [real(stuck); imag(stuck)], options);
  assert(norm(left) < 1e-9);
  u(j) = complex(x(1), x(2));
end
end

function x = parts(z)
x = [real(z); imag(z)];
end

function F = harmonic(u, element)
% First harmonic of the friction force: two periods of samples, the second one counts.
n = 512;
t = 2 * pi * (0:n - 1) / n;
q = real(u * exp(1i * t));
f = zeros(1, n);
z = 0;
previous = q(end);
for pass = 1:2
  for k = 1:n
    z = max(min(z + element.stiffness * (q(k) - previous), element.friction_limit_force), -element.friction_limit_force);
    previous = q(k);
    f(k) = z;
  end
end
F = 2 / n * sum(f .* exp(-1i * t));
end
